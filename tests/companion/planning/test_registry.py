"""What the tasks declare fits together: each name once, each name that is used declared."""

import itertools
import re
from inspect import getsource

import pytest

from companion.planning import search
from companion.planning.registry import Each, object_arguments, rows, tasks
from companion.tasks import parts

NAMED = re.compile(r'\(\s*"([a-z_]+)"')
OWN = {"a_replan", "a_tell", "a_some_done", "a_end"}


def test_each_task_that_can_be_asked_for_has_methods():
    """And no check is declared for another one."""
    assert set(tasks()) <= set(search.METHODS)
    assert {name for row in rows() for name in row.refused} <= set(tasks())


def test_each_name_of_a_row_is_declared():
    """A method around tasks is named in the rows of those tasks."""
    used = {one for methods in search.METHODS.values() for one in methods if isinstance(one, str)}
    assert used == set(search.AROUND)


@pytest.mark.parametrize("module", parts("plan"), ids=lambda module: module.__name__.split(".")[-2])
def test_each_subtask_is_declared(module):
    """Those that a method names: tasks, subtasks and actions, its own and those of other tasks."""
    methods = itertools.chain.from_iterable(module.PLAN.methods.values())
    declared = [one for one in methods if not isinstance(one, str)]
    around = (*declared, *module.PLAN.around.values())
    methods = [one.method if isinstance(one, Each) else one for one in around]
    named = {name for method in methods for name in NAMED.findall(getsource(method))}
    assert methods
    assert named <= {*search.METHODS, *search.ACTIONS, *search.CONDITIONS, *OWN}


def test_a_name_that_two_tasks_declare_is_refused():
    """With the name: GTPyhop would try the methods of both."""
    with pytest.raises(ValueError, match=r"declared by two tasks: set_down"):
        search.merged([{"set_down": 1, "take": 2}, {"set_down": 3}])


def test_the_things_of_a_task_are_its_arguments_of_that_kind():
    """Neither hand nor place."""
    assert object_arguments("pour", ("jar_1", "bowl_1")) == ("jar_1", "bowl_1")
    assert object_arguments("put_at", ("jar_1", "table")) == ("jar_1",)
    assert object_arguments("clear_table", ()) == ()
