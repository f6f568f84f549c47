"""The orchard map: fruits with one identity over all sessions, in one GeoPackage file."""

from pomona.orchard.added import Added
from pomona.orchard.adding import add_session, add_sessions
from pomona.orchard.fruit_ids import Change
from pomona.orchard.integrity import problems
from pomona.orchard.loading import load_session
from pomona.orchard.merging import Merged, merge_maps
from pomona.orchard.orchard_map import FruitsInMap, Observations, OrchardMap, Visit
from pomona.orchard.removing import Removed, remove_session
from pomona.orchard.session import Session
from pomona.orchard.stored_sessions import read_session
from pomona.orchard.writing import write_session
from pomona.store.schema import FORMAT_VERSION

__all__ = [
    "FORMAT_VERSION",
    "Added",
    "Change",
    "FruitsInMap",
    "Merged",
    "Observations",
    "OrchardMap",
    "Removed",
    "Session",
    "Visit",
    "add_session",
    "add_sessions",
    "load_session",
    "merge_maps",
    "problems",
    "read_session",
    "remove_session",
    "write_session",
]
