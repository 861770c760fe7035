"""Stopping the server: nothing that is under way may keep it."""

import signal
import threading
import time

import pytest

from app.jobs.thinker import Thinker
from app.store.events import Exchange
from planner.errors import EchoBaseError


def test_a_thinker_that_is_closed_answers_nothing_and_keeps_nobody():
    thinker, heard = Thinker(), []

    def ask():
        try:
            thinker.ask(time.sleep, 600.0)
        except EchoBaseError as error:
            heard.append(error.issues[0].code)

    assert thinker.ask(abs, -1) == 1
    asking = threading.Thread(target=ask)
    asking.start()
    thinker.close()
    asking.join(timeout=30.0)
    assert heard == ["server-closing"]
    with pytest.raises(EchoBaseError, match="being stopped"):
        thinker.ask(abs, -1)


@pytest.mark.timeout(60)
def test_the_signal_to_stop_may_come_in_the_middle_of_an_event():
    exchange, came = Exchange(), []

    def stop(*_):
        exchange.close()
        came.append(True)
        signal.setitimer(signal.ITIMER_REAL, 1e-4)

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 1e-4)
    try:
        while len(came) < 300:
            exchange.publish("project:a", "changed", {})
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert exchange.is_closed
