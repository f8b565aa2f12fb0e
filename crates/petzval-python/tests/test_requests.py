import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent.parent / "write_requests.py"


@pytest.mark.skipif(not SCRIPT.is_file(), reason="only beside the sources")
def test_the_typed_requests_are_those_of_the_schemas() -> None:
    spec = importlib.util.spec_from_file_location("write_requests", SCRIPT)
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert script.TARGET.read_text(encoding="utf-8") == script.module()
