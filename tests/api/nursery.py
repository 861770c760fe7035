"""A process that has everything imported and forks servers: a start then costs what a start costs, not what imports cost.

Speaks lines of JSON on standard input; answers on standard output.
"""

import json
import os
import sys
from pathlib import Path


def main() -> None:
    from app.server import serve  # noqa: PLC0415 - the import is what takes long

    for line in sys.stdin:
        order = json.loads(line)
        if order["do"] == "wait":
            _, status = os.waitpid(order["pid"], 0)
            say(status=os.waitstatus_to_exitcode(status))
            continue
        pid = os.fork()
        if pid == 0:
            os.close(0)
            os.environ.update(order["env"])
            os._exit(serve("127.0.0.1", order["port"], Path(order["data"])))
        say(pid=pid)


def say(**answer: int) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
