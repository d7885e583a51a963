"""Which skill performs which act: those of this toolkit, and those of the tasks."""

from companion import tasks
from companion.languages import rc
from companion.skills import moving
from companion.skills.skill import SkillRow

SKILLS: dict[type[rc.Command], SkillRow] = {
    row.act: row for part in (moving, *tasks.parts("perform")) for row in part.SKILLS
}
