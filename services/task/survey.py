"""The look around that ta asks for when somebody begins to observe the world."""

from companion.around import POINTS
from companion.languages import rc

SURVEY = rc.Look(key="survey", at=POINTS)
