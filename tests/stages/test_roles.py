from __future__ import annotations

import pytest

from vto_pipeline.errors import ScanError
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.stages.roles import ROLES, for_each_role


def failing(inputs, settings, job):
    raise ScanError("too little", partial={"surface": inputs["photos"]})


def test_a_partial_result_has_the_name_of_its_role():
    rows = for_each_role("s", "", needs=("photos",), makes=("surface",), run=failing, settings=Config, uses=())
    for role, row in zip(ROLES, rows, strict=True):
        with pytest.raises(ScanError) as caught:
            row.run({f"{role}_photos": role}, Config(), Job())
        assert caught.value.partial == {f"{role}_surface": role}
