"""Who may look: the page itself, asked for under an address that only this machine's owner can have typed."""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from urllib.parse import urlsplit

__all__ = ["why_refused"]

OWN_SITES = ("same-origin", "none")
"""What a browser says of a request that the page made, or that was typed."""


def why_refused(headers: Mapping[str, str]) -> str | None:
    """Tell what is wrong with a request's headers; None where nothing is.

    A page of somebody else can make a browser ask for anything here, and with a name of its own that it points to this
    machine even read the answer. It cannot do so under an address in numbers: so `Host` must be one, or `localhost`,
    and `Origin`, where a browser sends one, must be the same.
    """
    host = headers.get("host", "")
    if not _is_address(host):
        return "Host: expected localhost or an address in numbers"
    origin = headers.get("origin")
    if origin is not None and origin != f"http://{host}":
        return "Origin: expected this page"
    site = headers.get("sec-fetch-site", "none")
    is_followed_link = headers.get("sec-fetch-dest") == "document"
    if site not in OWN_SITES and not is_followed_link:
        return "Sec-Fetch-Site: expected this page"
    return None


def _is_address(host: str) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname
        return name == "localhost" or (name is not None and bool(ipaddress.ip_address(name)))
    except ValueError:
        return False
