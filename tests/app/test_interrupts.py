"""How commands end that somebody interrupts, or whose output nobody can take: documented codes, nothing left."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from skelgen.cli import main
from skelgen.errors import FormatError, WriteError, out_of_memory
from skelgen.files import UNFINISHED, arriving_together, replacing
from skelgen.interrupts import uninterrupted

ROOT = Path(__file__).parents[2]
BENCHMARK = ROOT / "tests" / "benchmarks" / "interrupts.py"
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(str(ROOT / name) for name in (".", "gui", "formats"))}
SKELGEN = [sys.executable, "-m", "skelgen"]
TRIES = 20  # programs that may have ended before a busy machine looks at them

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and closed streams of POSIX")


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Commands that are disturbed at moments that a seed chooses."""
    sys.path.insert(0, str(BENCHMARK.parent))
    spec = importlib.util.spec_from_file_location("interrupts", BENCHMARK)
    module = sys.modules["interrupts"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path.remove(str(BENCHMARK.parent))
    return module.Bench(tmp_path_factory.mktemp("bench"))


def in_shell(line, **options):
    """Exit code and error output of a line in which ``skelgen`` is the command."""
    line = f'skelgen() {{ "{sys.executable}" -m skelgen "$@"; }}; {line}'
    done = subprocess.run(["bash", "-c", line], env=ENVIRONMENT, capture_output=True, text=True, check=False, **options)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("command", "sent", "share"),
    [("convert", "INT", 0.6), ("convert", "TERM", 0.9), ("batch", "INT of the group", 0.5), ("batch", "KILL", 0.8)],
)
def test_what_ends_a_command_leaves_nothing_half_written(bench, command, sent, share):
    assert bench.disturb(command, sent, share).faults == ()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_while_the_program_is_loaded_is_one_line(wave, number, code):
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        pytest.skip("started by nohup: programs ignore that a terminal is closed")
    ends = (signalled(number, wave) for _ in range(TRIES))
    assert next(end for end in ends if end[0] != 0) == (code, "skelgen: interrupted\n")


def signalled(number, wave):
    """Exit code and error output of a program that gets a signal as soon as it handles such, unless it ends before."""
    with subprocess.Popen([*SKELGEN, "info", wave], env=ENVIRONMENT, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not handles(process.pid, signal.SIGHUP):
            time.sleep(0.001)
        process.send_signal(number)
        said = process.stderr.read()
    return process.returncode, said


def handles(pid, number):
    status = Path(f"/proc/{pid}/status")
    if not status.exists():
        pytest.skip("the system does not say which signals a process handles")
    caught = next(line.split()[1] for line in status.read_text().splitlines() if line.startswith("SigCgt:"))
    return int(caught, 16) >> (number - 1) & 1


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system does not tell of processes")
def test_processes_of_joblib_end_with_one_that_is_killed(tmp_path):
    lines = (
        "import os, signal, time",
        "from joblib import Parallel, delayed",
        "from skelgen.interrupts import end_with_parent",
        "def work(number):",
        "    end_with_parent()",
        "    open(f'{os.getpid()}.pid', 'w').close()",
        "    time.sleep(60)",
        "Parallel(n_jobs=2)(delayed(work)(number) for number in range(2))",
    )
    process = subprocess.Popen([sys.executable, "-c", "\n".join(lines)], cwd=tmp_path, env=ENVIRONMENT)
    pids = wait_until(lambda: [int(path.stem) for path in tmp_path.glob("*.pid")])
    process.kill()
    process.wait()
    assert wait_until(lambda: not any(is_running(pid) for pid in pids))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot fork")
def test_half_of_what_a_process_without_parent_takes_away_does_not_arrive(tmp_path):
    lines = (
        "import multiprocessing, os, pathlib, time",
        "from skelgen import interrupts",
        "from skelgen.files import arriving_together",
        "def slowly(folder):",
        "    (folder / 'a').unlink()",
        "    time.sleep(1)",
        "def work():",
        "    interrupts._remove = slowly",
        "    interrupts.end_with_parent()",
        "    with arriving_together(pathlib.Path('out')) as folder:",
        "        for name in 'ab': (folder / name).touch()",
        "        open(f'{os.getpid()}.pid', 'w').close()",
        "        while (folder / 'a').exists(): time.sleep(.01)",
        "multiprocessing.get_context('fork').Process(target=work).start()",
        "time.sleep(60)",
    )
    process = subprocess.Popen([sys.executable, "-c", "\n".join(lines)], cwd=tmp_path, env=ENVIRONMENT)
    pid = int(wait_until(lambda: [path.stem for path in tmp_path.glob("*.pid")])[0])
    process.kill()
    process.wait()
    assert wait_until(lambda: not is_running(pid))
    assert [path.name for path in (tmp_path / "out").iterdir() if not path.name.startswith(UNFINISHED)] == []


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell of processes")
def test_processes_of_python_are_deaf_to_an_interrupt_from_their_first_moment():
    lines = (
        "import multiprocessing, os, signal, time",
        "from skelgen.interrupts import deaf_children",
        "if __name__ == '__main__':",
        "    process = multiprocessing.get_context('spawn').Process(target=time.sleep, args=(60,), daemon=True)",
        "    with deaf_children():",
        "        process.start()",
        "    print(open(f'/proc/{process.pid}/status').read())",
        "    process.kill()",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    blocked = next(line.split()[1] for line in done.stdout.splitlines() if line.startswith("SigBlk:"))
    assert int(blocked, 16) >> (signal.SIGINT - 1) & 1


def wait_until(is_so, seconds=60.0):
    end = time.monotonic() + seconds
    while not (found := is_so()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return found


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


def test_an_interrupt_that_python_drops_ends_the_command_all_the_same():
    lines = (
        "import signal, sys",
        "from skelgen.cli.process import _Signals",
        "class Ending:",
        "    def __del__(self): signal.raise_signal(signal.SIGINT)",
        "signals = _Signals()",
        "signals.heed()",
        "one = Ending()",
        "del one",
        "print('goes on')",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "skelgen: interrupted\n")


def test_an_interrupt_amid_text_that_python_compiles_leaves_the_code_as_it_is(tmp_path):
    # as dataclasses do; `python -m` would then end as by SIGINT, whatever the signal was
    (tmp_path / "texts.py").write_text(
        "import sys\nfrom skelgen.cli import application, main\n"
        "def run(words):\n"
        "    import os, signal\n"
        "    try: exec('os.kill(os.getpid(), signal.SIGTERM)')\n"
        "    except KeyboardInterrupt: return 130\n"
        "application.run = run\nsys.exit(main())\n"
    )
    paths = ENVIRONMENT["PYTHONPATH"] + os.pathsep + str(tmp_path)
    done = subprocess.run([sys.executable, "-m", "texts"], env=ENVIRONMENT | {"PYTHONPATH": paths}, check=False)
    assert done.returncode == 143


def test_files_arrive_all_or_none_however_often_somebody_interrupts(tmp_path):
    with pytest.raises(KeyboardInterrupt), arriving_together(tmp_path / "new" / "out") as folder:
        for name in "abc":
            (folder / name).write_text(name)
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            (folder / "d").write_text("d")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("write", [replacing, lambda path: arriving_together(path.parent)])
def test_no_file_takes_the_place_of_a_pipe_or_a_device(tmp_path, write):
    os.mkfifo(tmp_path / "pipe.txt")
    with pytest.raises(WriteError, match="a pipe or a device has this name"), write(tmp_path / "pipe.txt") as temporary:
        (temporary / "pipe.txt" if temporary.is_dir() else temporary).write_text("data")
    assert (tmp_path / "pipe.txt").is_fifo()
    assert len(list(tmp_path.iterdir())) == 1


def test_a_link_stays_one(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "link.txt").symlink_to(tmp_path / "data" / "a.txt")
    with replacing(tmp_path / "link.txt") as temporary:
        temporary.write_text("data")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "data" / "a.txt").read_text() == "data"


def test_a_file_that_fails_leaves_no_folder(tmp_path):
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "new" / "folder" / "a.txt") as temporary:
        temporary.write_text("half")
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("skelgen formats > /dev/full", 2, "skelgen: error: the standard output cannot be written: No space left"),
        ("skelgen --help > /dev/full", 2, "skelgen: error: the standard output cannot be written: No space left"),
        ("skelgen config --json | true; exit ${PIPESTATUS[0]}", 141, ""),
        ("skelgen info wave.csm --json >&- <&-", 0, ""),
        ("skelgen info nothing.csm 2> /dev/full", 2, ""),
        ("skelgen convert wave.csm wave.trc > /dev/null 2>&-", 0, ""),
    ],
)
def test_output_that_nobody_takes_is_told_by_the_code(wave, line, code, said):
    returned, err = in_shell(line)
    assert returned == code
    assert err.startswith(said)
    assert err.count("\n") == bool(said)


@pytest.mark.parametrize(
    "words", ["info wave.csm", "demo", "run ../wave.csm", "convert ../wave.csm b.trc", "batch x -o y"]
)
def test_a_folder_that_is_gone_is_one_sentence(wave, words):
    returned, err = in_shell(f"mkdir gone; cd gone; rmdir ../gone; skelgen {words} -q")
    assert returned == 2
    assert err == "skelgen: error: the folder in which you work is gone; change to one that exists\n"


def test_too_little_memory_is_no_bug(wave):
    wrong = FormatError("a.c3d", "", "cannot be read")
    wrong.__cause__ = MemoryError("Unable to allocate 2.00 GiB")
    assert "Unable to allocate 2.00 GiB" in out_of_memory(wrong)
    assert out_of_memory(ImportError("libgfortran.so.5: failed to map segment from shared object"))
    assert out_of_memory(FormatError("a.c3d", "", "cannot be read")) == ""


def test_too_little_memory_is_told_by_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    main(["simulate", "rods", "-o", "short.c3d", "--n-frames", "100", "-q"])
    main(["simulate", "rods", "-o", "long.c3d", "--n-frames", "240000", "-q"])  # arrays of 50 MB
    lines = (
        "import pathlib, resource, sys",
        "from skelgen.cli import main",
        "main(['info', '--full', 'short.c3d'])",  # loads all that the command needs
        "used = int(pathlib.Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()",
        "resource.setrlimit(resource.RLIMIT_AS, (used + 30_000_000, used + 30_000_000))",
        "sys.exit(main(['info', '--full', 'long.c3d']))",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("skelgen: error: the memory of this computer does not suffice")
    assert done.stderr.count("\n") == 1
