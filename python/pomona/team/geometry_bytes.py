"""Places as bytes: GeoPackage puts its own head in front of well-known binary, PostGIS a number into it.

Source: OGC 12-128r17, section 2.1.3; PostGIS, extended well-known binary.
"""

from __future__ import annotations

import struct

from pomona.store.failures import WrongContentError

__all__ = ["geopackage_blob", "wkb_of"]

ENVELOPE_BYTES = (0, 32, 48, 48, 64)
"""By the kind of envelope in the flags."""

HEAD_BYTES = 8
LITTLE_ENDIAN = b"\x01"

EWKB_Z = 0x80000000
EWKB_SRID = 0x20000000
ISO_Z = 1000


def wkb_of(blob: bytes, srs_id: int) -> bytes:
    """Return the extended well-known binary of a geometry out of a GeoPackage, with its reference system."""
    if not isinstance(blob, bytes):
        raise WrongContentError(f"geom: found {type(blob).__name__}, expected a geometry")
    kind = blob[3] >> 1 & 7 if len(blob) >= HEAD_BYTES else len(ENVELOPE_BYTES)
    if not blob.startswith(b"GP") or kind >= len(ENVELOPE_BYTES):
        raise WrongContentError("geom: found bytes that are no geometry of a GeoPackage")
    wkb = blob[HEAD_BYTES + ENVELOPE_BYTES[kind] :]
    if len(wkb) < 5 or not wkb.startswith(LITTLE_ENDIAN):
        raise WrongContentError("geom: found big-endian numbers, expected little-endian ones")
    (iso,) = struct.unpack_from("<I", wkb, 1)
    base, has_z = iso % ISO_Z, iso // ISO_Z == 1
    extended = base | (EWKB_Z if has_z else 0) | (EWKB_SRID if srs_id else 0)
    return LITTLE_ENDIAN + struct.pack("<I", extended) + (struct.pack("<i", srs_id) if srs_id else b"") + wkb[5:]


def geopackage_blob(wkb: bytes, srs_id: int) -> bytes:
    """Return well-known binary (ISO, little-endian) as a GeoPackage holds it."""
    return b"GP\0\x01" + struct.pack("<i", srs_id) + wkb
