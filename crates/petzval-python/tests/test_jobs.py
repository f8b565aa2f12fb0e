import logging
import threading
import time
import warnings
from pathlib import Path

import pytest

import petzval as pz


def test_every_job_has_a_schema() -> None:
    names = pz.jobs.names()
    assert len(names) > 40 and {"lens-tolerance", "runs", "sweep-gather", "unit-list"} <= set(names)
    for name in names:
        request, response = pz.jobs.schema(name)
        assert "title" in request and "title" in response


def test_a_wrong_key_is_named() -> None:
    with pytest.raises(pz.InputError, match="lenss") as caught:
        pz.jobs.run("lens-show", {"lens": "cooke-triplet-nominal", "lenss": "x"})
    assert isinstance(caught.value, ValueError) and caught.value.kind == "input"
    with pytest.raises(pz.InputError, match="did you mean `lens-show`"):
        pz.jobs.run("lens-sho")
    for request, place in [
        ({"data": 5}, pz.Place(key="data", value="5")),
        ({"data": "no-folder"}, pz.Place(path=Path("no-folder"), key="data", value="no-folder")),
    ]:
        with pytest.raises(pz.InputError) as caught:
            pz.jobs.run("data-check", request)
        assert caught.value.place == place
    with pytest.raises(pz.InputError, match="not a run folder") as caught:
        pz.Run("no-folder")
    assert caught.value.place.path == Path("no-folder") and "petzval runs" in caught.value.hint


def test_the_verbs_of_runs_and_sweeps_are_jobs(tmp_path) -> None:
    assert pz.jobs.run("runs", {"folder": tmp_path}) == {"runs": [], "units": []}
    with pytest.raises(pz.InputError, match="no sweep is kept here"):
        pz.jobs.run("sweep-gather", {"store": tmp_path})


def test_an_error_in_a_file_has_its_place(tmp_path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text('name = "x"\nentrance_pupil_mm = "wide"\n')
    with pytest.raises(pz.InputError) as caught:
        pz.Lens.load(path)
    assert caught.value.place.path == path and caught.value.place.line == 2
    assert caught.value.kind == "file"


def test_warnings_and_notes_come_from_the_calling_thread(triplet: pz.Lens, caplog, tmp_path) -> None:
    with pytest.warns(pz.PetzvalWarning, match="holds"):
        request = {"lens": "cooke-triplet-nominal", "out": tmp_path / "psf", "fields": 2, "grid": 16}
        pz.jobs.run("psf", request)
    with caplog.at_level(logging.INFO, logger="petzval"):
        fields = [0.1 * i for i in range(33)]
        lens = triplet.with_(fields_deg=fields)
        request = {"lens": {"toml": lens.to_toml()}, "out": tmp_path / "a", "only": ["json"]}
        pz.jobs.run("lens-analyze", request)
    assert any("evenly chosen" in record.message for record in caplog.records)


def test_progress_tells_how_far_a_job_is() -> None:
    events: list[pz.jobs.Event] = []
    request = {"lens": "cooke-triplet-nominal", "trials": 40, "seed": 3}
    pz.jobs.run("lens-tolerance", request, progress=events.append)
    progress = [event for event in events if event["event"] == "progress"]
    for total in {event["total"] for event in progress}:
        done = [event["done"] for event in progress if event["total"] == total]
        assert done == sorted(done) and done[-1] <= total
    assert {event["total"] for event in progress} >= {40}


def test_an_exception_of_progress_stops_the_job() -> None:
    def listen(event: pz.jobs.Event) -> None:
        raise KeyError("enough")

    start = time.monotonic()
    with pytest.raises(KeyError, match="enough"):
        pz.jobs.run("lens-tolerance", {"lens": "cooke-triplet-nominal", "trials": 1_000_000}, progress=listen)
    assert time.monotonic() - start < 60


def test_a_flag_stops_a_job_from_another_thread() -> None:
    flag = pz.Cancel()
    timer = threading.Timer(0.3, flag.set)
    timer.start()
    with pytest.raises(pz.Stopped) as caught:
        pz.jobs.run("lens-tolerance", {"lens": "cooke-triplet-nominal", "trials": 1_000_000}, cancel=flag)
    assert caught.value.kept == [] and flag.is_set()


def test_threads_run_beside_each_other(triplet: pz.Lens) -> None:
    found: list[float] = []

    def work() -> None:
        for _ in range(10):
            found.append(float(triplet.spots([0.0]).rms_um[0]))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 40 and len(set(found)) == 1


def test_results_do_not_depend_on_the_number_of_threads(triplet: pz.Lens) -> None:
    wanted = triplet.spots().rms_um
    before = pz.threads()
    pz.set_threads(1)
    try:
        assert pz.threads() == 1
        assert (triplet.spots().rms_um == wanted).all()
    finally:
        pz.set_threads(before)


def test_no_warning_is_left_over(triplet: pz.Lens) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        triplet.spots([0.0])
