"""WM (world model), the language of queries, answers and observations on channels C4 and C6 (paper, section 5.4).

Its classes stand in four modules, and each is a name of this one.
"""

from companion.languages.wm.answers import *  # noqa: F403
from companion.languages.wm.answers import AnyAnswer
from companion.languages.wm.changes import *  # noqa: F403
from companion.languages.wm.observations import *  # noqa: F403
from companion.languages.wm.observations import AnyObservation, ObserveWorld
from companion.languages.wm.queries import *  # noqa: F403
from companion.languages.wm.queries import AnyQuery

Content = AnyQuery | AnyAnswer | AnyObservation | ObserveWorld
