"""What serves a page: where it listens, and at what address it is found."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import io
import ipaddress
import os
import socket
from collections.abc import Iterator

import viser

from mute.support.errors import MuteError

__all__ = ["page_address", "page_server"]

_LAST_PORT = 65535


@contextlib.contextmanager
def page_server(host: str, port: int) -> Iterator[viser.ViserServer]:
    """Yield a server that serves a page.

    Args:
        host: Name or address to listen at; 127.0.0.1 is seen by this machine alone.
        port: Port to listen at; where it is taken, the next free one.

    Raises:
        MuteError: If it cannot listen there.
    """
    # viser itself tries on without end where it cannot listen, and says nothing.
    free = _free_port(host, port)
    with contextlib.redirect_stdout(io.StringIO()):  # viser prints a banner
        server = viser.ViserServer(host=host, port=free, label="MUTE", verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def page_address(host: str, port: int) -> str:
    """Return the address to open in a browser of this machine, of a page that is served.

    Args:
        host: Name or address that it listens at.
        port: The port.
    """
    return f"http://{_opened_at(host)}:{port}"


def _opened_at(host: str) -> str:
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    if address.is_unspecified:  # all addresses of the machine, of which none is a place to go to
        return "localhost"
    return f"[{host}]" if address.version == 6 else host


def _free_port(host: str, port: int) -> int:
    """Return the first port from one on that can be listened at.

    Raises:
        MuteError: If there is none.
    """
    for candidate in range(port, _LAST_PORT + 1):
        try:
            asyncio.run(_listen(host, candidate))
        except (OSError, ValueError) as error:  # a ValueError where a name cannot be one
            if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
                continue
            raise MuteError(
                f"no page at --host {host!r} --port {candidate}: {_reason(error)}; the host must "
                "be a name or an address of this machine, the port one that it may listen at"
            ) from error
        return candidate
    raise MuteError(f"no page at --host {host!r} --port {port}: it and all after it are taken")


async def _listen(host: str, port: int) -> None:
    """Listen for a moment, as the server is going to.

    Raises:
        OSError: If that cannot be.
        ValueError: If the name cannot be one.
    """
    loop = asyncio.get_running_loop()
    listening = await loop.create_server(asyncio.Protocol, host, port)
    listening.close()
    await listening.wait_closed()


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, socket.gaierror):
        return error.strerror or str(error)
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return str(error)
