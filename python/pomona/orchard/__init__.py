"""The orchard map: fruits with one identity over all sessions, in one GeoPackage file."""

from pomona.orchard.reading import load_session, read_cloud, read_session
from pomona.orchard.session import Session
from pomona.orchard.writing import write_session

__all__ = ["Session", "load_session", "read_cloud", "read_session", "write_session"]
