"""From a recording to the fruits of one visit, each once."""

from pomona.survey.files import write_stages, write_survey
from pomona.survey.kept import Kept
from pomona.survey.part import Boxes, Part
from pomona.survey.story import Progress, Survey, scan

__all__ = ["Boxes", "Kept", "Part", "Progress", "Survey", "scan", "write_stages", "write_survey"]
