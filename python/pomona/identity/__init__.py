"""One identity for each fruit over all visits: `conclusion.py` tells the story; equations in `docs/identities.md`."""

from pomona.identity.common_frame import frames_of_visits
from pomona.identity.conclusion import Conclusion, conclude
from pomona.identity.visits import SeenVisit, VisitPair
from pomona.identity.winters import SEASON_DAYS, seasons_of

__all__ = ["SEASON_DAYS", "Conclusion", "SeenVisit", "VisitPair", "conclude", "frames_of_visits", "seasons_of"]
