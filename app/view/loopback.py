"""One viser server on the loopback interface, closed to everybody but EchoBase's own proxy.

Uses a private part of viser 1.1.1, checked at start: `_websock_server` with `_live_connections`, `on_client_connect`,
`unregister_handler`, `disconnect_all_clients`, and a client's `_websock_connection.queue_message`.
"""

import os
from typing import Any

import viser
from viser import _messages

KEY_HEADER = "X-EchoBase-Key"
USER_HEADER = "X-EchoBase-User"


def start_loopback(key: str) -> viser.ViserServer:
    """Return a viser server on a free loopback port that accepts only connections carrying the key."""
    os.environ.pop("_VISER_PORT_OVERRIDE", None)  # viser would obey it whatever port is asked for
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    socket = checked_private_surface(server)

    async def guard(connection: Any) -> None:
        live = socket._live_connections[connection.client_id]
        if live.request.headers.get(KEY_HEADER) != key:
            await live.close(1008, "forbidden")

    socket.on_client_connect(guard)
    # Any client could otherwise ask the server to open a public tunnel.
    socket.unregister_handler(_messages.ShareUrlRequest)
    socket.unregister_handler(_messages.ShareUrlDisconnect)
    server.gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=False)
    return server


def checked_private_surface(server: viser.ViserServer) -> Any:
    """Return viser's WebSocket server, or raise RuntimeError if this viser is not the one EchoBase was built for."""
    socket = getattr(server, "_websock_server", None)
    wanted = ("_live_connections", "on_client_connect", "unregister_handler", "disconnect_all_clients")
    missing = [name for name in wanted if not hasattr(socket, name)]
    missing += [
        n
        for n in ("ShareUrlRequest", "ShareUrlDisconnect", "SetSceneNodeVisibilityMessage")
        if not hasattr(_messages, n)
    ]
    if viser.__version__ != "1.1.1" or missing:
        server.stop()
        raise RuntimeError(f"viser {viser.__version__} is not supported (missing: {missing}); install viser 1.1.1")
    return socket


def user_of(server: viser.ViserServer, client_id: int) -> str:
    """Return the name the proxy gave for a browser, or an empty string."""
    live: Any = server._websock_server._live_connections.get(client_id)
    return str(live.request.headers.get(USER_HEADER, "")) if live is not None else ""


def show_for(client: viser.ClientHandle, name: str, visible: bool) -> None:
    """Show or hide a shared node in one browser only."""
    client._websock_connection.queue_message(_messages.SetSceneNodeVisibilityMessage(str(name), bool(visible)))


def place_for(client: viser.ClientHandle, name: str, xyz_m: tuple[float, ...], wxyz: tuple[float, ...]) -> None:
    """Move a shared node in one browser only."""
    x, y, z = (float(v) for v in xyz_m)
    q0, q1, q2, q3 = (float(v) for v in wxyz)
    client._websock_connection.queue_message(_messages.SetPositionMessage(str(name), (x, y, z)))
    client._websock_connection.queue_message(_messages.SetOrientationMessage(str(name), (q0, q1, q2, q3)))
