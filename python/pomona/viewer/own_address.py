"""The address of this machine that a browser can open, here and on other machines."""

from __future__ import annotations

import contextlib
import ipaddress
import socket

__all__ = ["own_address"]

FAR_AWAY = ((socket.AF_INET6, "2001:db8::1"), (socket.AF_INET, "192.0.2.1"))
"""Nobody's addresses, kept for documentation: whoever would go there leaves by the address that others see."""


def own_address(taken: socket.socket) -> str:
    """Return where a socket that listens can be asked, in numbers.

    One that listens on all addresses of this machine has none that could be opened: then it is the address by which
    this machine talks to others, else the one by which it talks to itself.
    """
    listened = ipaddress.ip_address(taken.getsockname()[0])
    if not listened.is_unspecified:
        return str(listened)
    for family, far in FAR_AWAY:
        if not _answers(taken, family):
            continue
        # A datagram socket sends nothing when it connects: it only chooses its own end.
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as asked:
            asked.connect((far, 9))
            return str(asked.getsockname()[0])
    return "127.0.0.1" if listened.version == 4 else "::1"


def _answers(taken: socket.socket, family: socket.AddressFamily) -> bool:
    """Tell whether addresses of a family reach it: those of IPv4 reach most sockets of IPv6, too."""
    if taken.family == family:
        return True
    return taken.family == socket.AF_INET6 and not taken.getsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY)
