"""The word that lets others look: in the address that is handed to them, then in a cookie of their browser."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
import secrets
from collections.abc import Mapping

from pomona.errors import PomonaError

__all__ = ["cookie_name", "is_known", "token_for"]

BYTES = 24
"""Of a token that is made up: nobody guesses 192 bits."""

TOKEN = re.compile(r"[A-Za-z0-9_-]{16,200}")


def token_for(address: str, wanted: str | None) -> str | None:
    """Return the token that visitors must know; None where only this machine can look and nobody wants one.

    Parameters
    ----------
    address
        In numbers, where the page is listened for.
    wanted
        A token that is to hold between runs; else one is made up.

    Raises
    ------
    PomonaError
        When the token that is wanted is short, or would not stand in an address as it is.
    """
    if wanted is not None:
        if not TOKEN.fullmatch(wanted):
            found = f"{len(wanted)} characters"
            raise PomonaError(f"--token: found {found}, expected 16 to 200 of a letter, a digit, '-' or '_'")
        return wanted
    return None if ipaddress.ip_address(address).is_loopback else secrets.token_urlsafe(BYTES)


def cookie_name(token: str) -> str:
    """Return the cookie of a token: browsers keep cookies by machine, and two maps may be shown on two ports."""
    return f"pomona_{hashlib.sha256(token.encode()).hexdigest()[:12]}"


def is_known(token: str, told: str | None, cookies: Mapping[str, str]) -> bool:
    """Tell whether a visitor knows the token, by the address or by the cookie; it takes as long whatever they say."""
    said = told if told is not None else cookies.get(cookie_name(token), "")
    return hmac.compare_digest(token.encode(), said.encode("utf-8", "surrogateescape"))
