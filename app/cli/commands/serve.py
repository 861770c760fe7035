"""`echobase serve`."""

import argparse
from typing import Any

from app.cli.run import DONE


def run(args: argparse.Namespace) -> tuple[dict[str, Any] | None, int]:
    """Serve the page, REST and the 3D view until interrupted."""
    from app.server import serve  # noqa: PLC0415 - only this command needs the web

    serve(host=args.host, port=args.port, data=args.data)
    return None, DONE
