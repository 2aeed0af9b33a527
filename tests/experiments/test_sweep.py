"""Sweeps: the same results everywhere, nothing lost and nothing twice, and sentences where something goes wrong."""

import contextlib
import functools
import importlib
import os
import pickle
import re
import signal
import socket
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

from steer_env.experiments import sweep
from steer_env.experiments.cli.common.sweeping import runner
from steer_env.experiments.cli.main import main, parsed
from steer_env.experiments.sweep import dask_cluster, store, work
from steer_env.experiments.sweep.sweep import case_key
from tests.experiments import sweep_cases as cases
from tests.needs import needs

TWO = sweep.Where(2)
PLACES = [TWO, sweep.Where(2, "local")]
PARALLEL = [TWO, pytest.param(PLACES[1], marks=pytest.mark.whole)]
EVERYWHERE = [sweep.SERIAL, *PARALLEL]
ROOT = Path(__file__).parents[2]
posix = pytest.mark.skipif(sys.platform == "win32", reason="sends signals")


def kept_in(folder, **changes):
    """A store of this program, or of one that differs from it."""
    return sweep.Store(folder / "store", work.identity() | changes)


def numbers(folder, seconds=0.05, killer=None, count=10):
    """Cases that leave files in a folder."""
    (folder / "marks").mkdir(exist_ok=True)
    return [(str(folder / "marks"), x, seconds, killer) for x in range(count)]


def same(results, count=10):
    return [each.tobytes() for each in results] == [cases.rooted(x).tobytes() for x in range(count)]


@pytest.mark.parametrize("where", EVERYWHERE)
def test_results_are_the_same_to_the_bit_everywhere(where):
    seen = []
    with sweep.work.one_blas_thread():
        assert same(sweep.run(cases.rooted, range(10), where=where, notify=lambda *told: seen.append(told)))
    assert [share for share, _ in seen] == [k / 10 for k in range(1, 11)]


def test_what_is_done_is_told_by_what_cases_cost_also_of_those_that_are_kept(tmp_path):
    """Cases of 1, 2 and 3 are 1/6, 1/2 and all; the first two are kept and are not handed over again."""
    seen, handed = [], []
    sweep.run(cases.rooted, [1, 2], store=kept_in(tmp_path), finished=lambda *each: handed.append(each))
    assert [(case, result.tobytes()) for case, result in handed] == [(x, cases.rooted(x).tobytes()) for x in (1, 2)]
    again = {"store": kept_in(tmp_path), "cost": float, "notify": lambda *told: seen.append(told)}
    sweep.run(cases.rooted, [1, 2, 3], **again, finished=lambda *each: handed.append(each))
    assert seen == [(0.5, "2 of 3 finished before"), (1.0, "3 of 3, 3")]
    assert [case for case, _ in handed] == [1, 2, 3]


@pytest.mark.whole
@pytest.mark.parametrize("where", EVERYWHERE)
def test_a_worker_uses_one_thread(where):
    for blas, rows, process in sweep.run(cases.threads, range(3), where=where):
        assert blas == {1}
        assert rows == (1 if process != os.getpid() else (os.cpu_count() or 1))


@pytest.mark.parametrize("where", [sweep.SERIAL, *(pytest.param(each, marks=pytest.mark.whole) for each in PLACES)])
def test_an_error_carries_the_case_and_what_is_finished_is_kept(where, tmp_path):
    with pytest.raises(ValueError, match=r"^case 3: three is odd$"):
        sweep.run(cases.odd, range(4), where=where, store=kept_in(tmp_path), words=lambda x: f"case {x}")
    if where == sweep.SERIAL:
        assert kept_in(tmp_path).count() == 3
    with pytest.raises(RuntimeError, match=r"(?s)5: KeyError: 'five'.*sweep_cases.py"):
        sweep.run(cases.odd, [1, 5], where=where)


def test_a_resumed_sweep_runs_what_is_left(tmp_path):
    some = numbers(tmp_path, 0.0)
    sweep.run(cases.counted, some[:4], store=kept_in(tmp_path))
    assert same(sweep.run(cases.counted, some, store=kept_in(tmp_path)))
    assert cases.marks(tmp_path / "marks", "done") == list(range(10))
    damaged = next((tmp_path / "store").glob(f"*{store.CASE_SUFFIX}"))
    damaged.write_bytes(damaged.read_bytes()[:-1])
    assert same(sweep.run(cases.counted, some, store=kept_in(tmp_path)))
    assert len(cases.marks(tmp_path / "marks", "done")) == 11


def test_results_of_another_program_are_refused_and_nobody_elses_files_deleted(tmp_path):
    sweep.run(cases.rooted, range(3), store=kept_in(tmp_path, sources="0123"))
    with pytest.raises(ValueError, match=r"was computed with sources 0123 \(here .*begin anew without --resume"):
        kept_in(tmp_path)
    anew = sweep.Store(tmp_path / "store", work.identity(), resume=False)
    assert anew.count() == 0
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ValueError, match="holds other files than those of a sweep"):
        sweep.Store(tmp_path, work.identity(), resume=False)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_keys_tell_functions_cases_and_programs_apart_and_not_processes():
    case = {"law": "lugre", "values": [1.0, 2.0], "names": {"a", "b", "c"}}
    code = f"from steer_env.experiments.sweep.sweep import case_key; print(case_key('m:f', {case!r}))"
    command = [sys.executable, "-c", code]
    found = {subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() for _ in range(2)}
    assert found == {case_key("m:f", case)}
    others = [("m:g", case), ("m:f", case | {"law": "masing"}), ("m:f", case, {"sources": "other"})]
    assert len({*found, *(case_key(*other) for other in others)}) == 4


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Writes modules of a user's own, and forgets what was imported of them; their folder is on the path."""
    monkeypatch.syspath_prepend(tmp_path / "own")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "own").mkdir()
    written = set()

    def write(**sources):
        for name, text in sources.items():
            file = tmp_path / "own" / (name.replace("__", "/") + ".py")
            file.parent.mkdir(exist_ok=True)
            file.write_text(text)
            written.add(name.partition("__")[0])
        forget()
        return lambda name: importlib.import_module(name)

    def forget():
        for name in [name for name in sys.modules if name.partition(".")[0] in written]:
            del sys.modules[name]
        importlib.invalidate_caches()

    yield write
    forget()


STUDY = "def drive(x):\n    from my_laws import slip\n    return x * slip.FACTOR\n"


def test_results_of_other_code_of_the_user_are_not_taken(own, tmp_path):
    """Neither of the function itself, nor of what its module imports within a function from a package."""
    results = []
    for factor in ("2", "1000"):
        load = own(my_study=STUDY, my_laws__slip="from .tables import FACTOR\n", my_laws__tables=f"FACTOR = {factor}\n")
        results += sweep.run(load("my_study").drive, [1.0, 2.0], store=kept_in(tmp_path))
    load = own(my_study="def drive(x):\n    return -x\n")
    results += sweep.run(load("my_study").drive, [1.0, 2.0], store=kept_in(tmp_path))
    assert results == [2.0, 4.0, 1000.0, 2000.0, -1.0, -2.0]
    assert kept_in(tmp_path).count() == 6
    with pytest.raises(ValueError, match=r"computed with module my_study None \(here [0-9a-f]{16}\)"):
        sweep.Store(tmp_path / "store", work.identity(["my_study"]))


def test_a_case_of_an_own_class_is_another_with_other_code(own, tmp_path):
    """Parameters of a friction law go by the name of their class."""
    text = "from typing import NamedTuple\nclass Law(NamedTuple):\n    k: float = 1.0\n    def __float__(self):\n"
    found = []
    for body in ("return self.k", "return 3 * self.k", "return 3 * self.k"):
        load = own(my_law=f"{text}        {body}\n")
        found += sweep.run(cases.as_number, [load("my_law").Law()], store=kept_in(tmp_path))
    assert (found, kept_in(tmp_path).count()) == ([1.0, 3.0, 3.0], 2)


def test_a_worker_with_another_own_law_refuses(own):
    own(my_law="import my_table\n", my_table="K = 1.0\n")
    mine = work.identity(["my_law"])
    assert set(mine) - set(work.identity()) == {"module my_law", "module my_table"}
    task = work.Task(0, work.importable_name(cases.rooted), pickle.dumps(2), mine, ("my_law",))
    assert not work.perform_case(task).failure
    own(my_table="K = 20.0\n")
    found = work.perform_case(task)
    assert found.failure == work.REFUSED
    assert re.search(r"has module my_table \w+ in place of \w+: install there what", found.message)
    found = work.perform_case(task._replace(modules=("not_there",)))
    assert (found.failure, "No module named 'not_there'" in found.message) == (work.REFUSED, True)


def test_a_worker_tells_what_it_has_loaded_and_not_what_the_file_became(own, tmp_path):
    load = own(my_law="K = 1.0\n")
    before = work.identity_with(["my_law"])
    (tmp_path / "own" / "my_law.py").write_text("K = 20.0\n")
    assert work.identity(["my_law"]) == before
    importlib.reload(load("my_law"))
    assert work.identity(["my_law"]) != before


def test_a_function_without_a_source_is_refused(tmp_path, monkeypatch):
    module = types.ModuleType("typed_in")
    exec("def drive(x):\n    return x\n", vars(module))
    monkeypatch.setitem(sys.modules, "typed_in", module)
    with pytest.raises(ValueError, match="the source of the module typed_in cannot be read"):
        sweep.run(module.drive, [1.0], store=kept_in(tmp_path))


def test_resume_refuses_results_of_another_imported_module(own, tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda name: str(tmp_path / "cache" / name))
    own(my_law="K = 1.0\n")
    command = ["run", "all", "--import", "my_law", "--workers", "1"]
    with pytest.raises(ValueError, match="three is odd"):
        runner(parsed(command))(cases.odd, [1, 2, 3])
    own(my_law="K = 20.0\n")
    with pytest.raises(ValueError, match=r"computed with module my_law \w+ \(here \w+\): resume with that version"):
        runner(parsed([*command, "--resume"]))(cases.odd, [1, 2, 3])


def test_what_cannot_be_sent_is_said():
    with pytest.raises(ValueError, match="define the function at the top of a module"):
        sweep.run(lambda x: x, [1])
    with pytest.raises(ValueError, match="cannot be sent to a worker"):
        sweep.run(cases.odd, [lambda: 1])


@pytest.mark.parametrize(
    ("options", "place"),
    [
        ((3, None), sweep.Where(3)),
        ((1, None), sweep.SERIAL),
        ((None, "local:3"), sweep.Where(3, "local")),
        ((2, "local"), sweep.Where(2, "local")),
        ((None, "tcp://10.0.0.1:8786"), sweep.Where(1, "tcp://10.0.0.1:8786")),
        ((None, "tls://[::1]:8786"), sweep.Where(1, "tls://[::1]:8786")),
    ],
)
def test_places_are_read(options, place):
    assert sweep.Where.parse(*options) == place


def test_the_usual_number_of_workers_can_be_set(monkeypatch):
    monkeypatch.setenv("STEER_ENV_WORKERS", "7")
    assert sweep.Where.parse() == sweep.Where(7)
    assert sweep.Where.parse(2) == TWO
    monkeypatch.setenv("STEER_ENV_WORKERS", "many")
    with pytest.raises(ValueError, match="STEER_ENV_WORKERS must be a whole number"):
        sweep.Where.parse()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ((0, None), "at least 1"),
        ((2, "local:2"), "say the same thing"),
        ((None, "local:0"), "local, local:N"),
        ((None, "http://10.0.0.1:8786"), "local, local:N"),
        ((None, "tcp://10.0.0.1"), "local, local:N"),
        ((2, "tcp://10.0.0.1:8786"), "leave --workers out"),
    ],
)
def test_places_that_are_none_are_refused(options, reason):
    with pytest.raises(ValueError, match=reason):
        sweep.Where.parse(*options)


@pytest.mark.whole
@posix
@pytest.mark.parametrize("where", PARALLEL)
def test_a_killed_worker_loses_nothing_and_doubles_nothing(where, tmp_path):
    found = sweep.run(cases.counted, numbers(tmp_path, killer=4), where=where, store=kept_in(tmp_path))
    assert same(found)
    assert cases.marks(tmp_path / "marks", "done") == list(range(10))
    assert cases.marks(tmp_path / "marks", "begun").count(4) == 2


@posix
@pytest.mark.whole
@pytest.mark.parametrize("where", PLACES)
def test_a_case_that_kills_every_worker_ends_in_a_sentence(where, tmp_path):
    with pytest.raises(sweep.LostError, match=r"died (3 times in a row|again and again).*finished work is kept"):
        sweep.run(cases.fatal, [1, 2], where=where, store=kept_in(tmp_path))


CLIENT = """
import sys
from pathlib import Path
from steer_env.experiments import sweep
from tests.experiments import sweep_cases, test_sweep
if __name__ == "__main__":
    folder, where = Path(sys.argv[1]), sweep.Where.parse(2, sys.argv[2] or None)
    sweep.run(sweep_cases.counted, test_sweep.numbers(folder, 0.3), where=where, store=test_sweep.kept_in(folder))
"""


def killed(folder, cluster, number):
    """Start a sweep in a process of its own, and end it by a signal when some cases are finished."""
    (folder / "client.py").write_text(CLIENT)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    heard = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen([sys.executable, folder / "client.py", folder, cluster], env=environment, preexec_fn=heard,
                          stderr=subprocess.DEVNULL) as client:  # fmt: skip
        while len(list((folder / "store").glob(f"*{store.CASE_SUFFIX}"))) < 3:
            assert client.poll() is None
            time.sleep(0.02)
        client.send_signal(number)
    end = time.monotonic() + 60.0
    while alive := {process for process in cases.processes(folder / "marks") if Path(f"/proc/{process}").exists()}:
        assert time.monotonic() < end, alive
        time.sleep(0.05)


@pytest.mark.whole
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks for processes in /proc")
@pytest.mark.parametrize(("cluster", "number"), [("", signal.SIGINT), ("", signal.SIGKILL), ("local", signal.SIGKILL)])
def test_a_killed_client_takes_its_workers_along_and_is_resumed(cluster, number, tmp_path):
    killed(tmp_path, cluster, number)
    finished = cases.marks(tmp_path / "marks", "done")
    assert 3 <= len(finished) < 10
    assert same(sweep.run(cases.counted, numbers(tmp_path, 0.3), where=TWO, store=kept_in(tmp_path)))
    assert cases.marks(tmp_path / "marks", "done") == list(range(10))


@pytest.fixture
def port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture
def scheduler(port):
    """A Dask scheduler in a process of its own."""
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port)]
    with subprocess.Popen([*command, "--no-dashboard"], stderr=subprocess.DEVNULL) as process:
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
                break
            assert process.poll() is None
            time.sleep(0.1)
        yield process, f"tcp://127.0.0.1:{port}"
        process.kill()


@contextlib.contextmanager
def dask_worker(address, *options):
    """A worker in a process of its own, which ends with the block."""
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard", *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment) as worker:
        try:
            yield
        finally:
            worker.kill()


@needs("distributed")
def test_a_cluster_that_is_not_there_is_said_at_once(port):
    start = time.monotonic()
    with pytest.raises(sweep.LostError, match=f"there is no Dask scheduler at tcp://127.0.0.1:{port}"):
        sweep.run(cases.rooted, range(3), where=sweep.Where(1, f"tcp://127.0.0.1:{port}"))
    assert time.monotonic() - start < 10.0


@needs("distributed")
def test_an_encrypted_cluster_needs_a_certificate():
    with pytest.raises(ValueError, match="needs a certificate of this client"):
        sweep.run(cases.rooted, [1], where=sweep.Where(1, "tls://127.0.0.1:8786"))


@pytest.mark.whole
@posix
def test_a_cluster_that_dies_leaves_what_is_finished(scheduler, tmp_path):
    process, address = scheduler
    with dask_worker(address, "--nthreads", "1"):

        def end(share, _):
            if share >= 0.3:
                process.kill()

        with pytest.raises(sweep.LostError, match="went away; finished work is kept"):
            sweep.run(cases.counted, numbers(tmp_path, 0.3), where=sweep.Where(1, address), store=kept_in(tmp_path),
                      notify=end)  # fmt: skip
    assert kept_in(tmp_path).count() >= 3
    assert same(sweep.run(cases.counted, numbers(tmp_path), where=TWO, store=kept_in(tmp_path)))


@pytest.mark.whole
def test_workers_that_must_not_take_part_are_named(scheduler, monkeypatch):
    _, address = scheduler
    where = sweep.Where(1, address)
    monkeypatch.setattr(dask_cluster, "PATIENCE", 3.0)
    with pytest.raises(sweep.LostError, match="has no worker after 3 s"):
        sweep.run(cases.rooted, range(3), where=where)
    monkeypatch.setattr(dask_cluster, "PATIENCE", 30.0)
    threads = r"the worker tcp://.* runs 2 cases at once.*start it with --nthreads 1"
    with dask_worker(address, "--nthreads", "2"), pytest.raises(ValueError, match=threads):
        sweep.run(cases.rooted, range(3), where=where)
    with dask_worker(address, "--nthreads", "1"):
        assert same(sweep.run(cases.rooted, range(10), where=where))
        other = work.identity() | {"sources": "0123"}
        monkeypatch.setattr(dask_cluster, "identity", lambda *_: other)
        with pytest.raises(ValueError, match=r"the worker tcp://.* has sources .* in place of 0123: install there"):
            sweep.run(cases.rooted, range(3), where=where)


def test_the_words_that_a_trace_keeps_do_not_tell_where_cases_ran():
    words = ["run", "all", "--friction", "masing", "--rate-hz=100"]
    assert parsed([*words, "--workers", "2", "--resume"]).argv == words
    assert parsed(["train", "--env", "steer_env/AssistWeave-v3", "--resume"]).argv[-1] == "--resume"


@needs("distributed")
def test_options_are_checked_before_the_work_begins(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "weave", "--workers", "2"]) == 2
    assert main(["report", "--cluster", "somewhere"]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert "--workers has no effect here, as one manoeuvre is one case: use it with all" in errors[0]
    assert "--cluster must be local, local:N" in errors[1]
    assert not list(tmp_path.iterdir())


def test_a_command_that_is_interrupted_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda name: str(tmp_path / "cache" / name))
    some = numbers(tmp_path, 0.0)

    def interrupt(share, _):
        if share == 0.5:
            raise KeyboardInterrupt

    def end(fault):
        def run(args):
            assert same(runner(args)(cases.counted, some, notify=interrupt if fault == "sweep" else lambda *_: None))
            if fault == "page":
                raise OSError("no space left")

        monkeypatch.setattr("steer_env.experiments.cli.run.run", run)
        return main(["run", "all", "--workers", "1", *(["--resume"] if fault != "sweep" else [])])

    assert end("sweep") == 130
    assert "5 of 10 cases are finished and kept: the same command with --resume" in capsys.readouterr().err
    assert end("page") == 2  # after the last case: they are needed once more
    assert "10 of 10 cases are finished and kept" in capsys.readouterr().err
    assert end("") == 0
    assert cases.marks(tmp_path / "marks", "done") == list(range(10))
    assert not list((tmp_path / "cache" / "steer_env" / "sweeps").iterdir())
