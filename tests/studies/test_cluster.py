"""Studies on clusters whose processes are killed: the same command goes on, and gives the same table."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tiny_study import write_tiny_study

pytest.importorskip("distributed", reason="the extra cohort is not installed")

from faults import children, ended, started

TABLES = ("cohort.csv", "cohort.html")
#: How long a cluster may take to come up, or a study to begin [s].
PATIENCE = 120.0


class Cluster:
    """A scheduler and workers, each a process started by Dask's own commands."""

    def __init__(self, folder, count=2):
        self.folder, self.file, self.processes = folder, folder / "scheduler.json", {}
        self.start("scheduler", "--port", "0", "--scheduler-file", self.file, "--no-dashboard")
        for number in range(count):
            self.worker(number)

    def start(self, kind, *arguments):
        command = [sys.executable, "-m", "dask", kind, *map(str, arguments)]
        folder = self.folder / "log"
        with folder.open("a") as log:
            self.processes[kind, arguments] = subprocess.Popen(command, stdout=log, stderr=log)
        return self.processes[kind, arguments]

    def worker(self, number):
        more = "--nthreads", 1, "--no-nanny", "--name", number, "--no-dashboard"
        return self.start("worker", "--scheduler-file", self.file, *more)

    @property
    def address(self):
        wait_for(lambda: self.file.exists() and self.file.stat().st_size)
        return json.loads(self.file.read_text())["address"]

    def close(self):
        for process in self.processes.values():
            process.kill()
            process.wait()


def wait_for(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it did not come"
        time.sleep(0.05)


@pytest.fixture
def cluster(tmp_path):
    folder = tmp_path / "cluster"
    folder.mkdir()
    found = Cluster(folder)
    yield found
    found.close()


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study, and its table by one thread of this process."""
    import distributed

    from vtkmuscle.studies.cohort import Study, run_study

    file = write_tiny_study(tmp_path_factory.mktemp("study"))
    with distributed.Client(
        processes=False, n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as client:
        run_study(Study.load(file), file.parent / "whole", client=client)
    return file


def same(study, out):
    same_tables(study, out)
    assert not list(out.rglob(".*"))


def same_tables(study, out):
    for name in TABLES:
        assert (out / name).read_bytes() == (study.parent / "whole" / name).read_bytes(), name


@pytest.mark.long
def test_a_cluster_started_by_hand_that_loses_a_worker_and_the_client_gives_the_same_table(
    study, cluster, tmp_path, tried
):
    out = tmp_path / "out"
    command = ("cohort", study, "--out", out, "--scheduler", cluster.address, "--quiet")
    process = started(*command)
    wait_for(lambda: list(out.glob("parts/*/*/*/*/*.npz")) or process.poll() is not None)
    (_, *workers) = cluster.processes.values()
    workers[0].kill()
    time.sleep(0.2)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    tried.add("a cohort, its worker and its client killed", "used")
    status, _, errors = ended(started(*command), timeout=PATIENCE)
    assert status == 1, errors  # carl's files are damaged
    assert "spindle.vtp" in errors
    same(study, out)


def test_nobody_without_its_key_can_talk_to_the_cluster_of_this_machine(study, tmp_path):
    """Whoever can connect to a scheduler has code executed: here any user of the machine could."""
    import distributed

    from vtkmuscle.studies.cohort import Study, run_study

    addresses = []

    def strangers(progress):
        if addresses:
            return
        found = distributed.default_client().scheduler_info(n_workers=-1)
        addresses.extend([found["address"], *found["workers"]])
        for address in addresses:
            plain = address.replace("tls://", "tcp://")
            for key in (None, distributed.Security.temporary()):
                with pytest.raises(OSError, match=r"Timed out|TLS|certificate|closed"):
                    distributed.Client(address if key else plain, security=key, timeout=2)

    run_study(Study.load(study), tmp_path / "out", workers=1, progress=strangers)
    assert len(addresses) == 2


@pytest.mark.long
def test_a_scheduler_that_is_killed_is_one_error_and_the_same_command_goes_on(
    study, cluster, tmp_path, tried
):
    out = tmp_path / "out"
    process = started("cohort", study, "--out", out, "--scheduler", cluster.address, "--quiet")
    wait_for(lambda: list(out.glob("parts/*/*/*/*/*.npz")) or process.poll() is not None)
    next(iter(cluster.processes.values())).kill()
    status, _, errors = ended(process, timeout=PATIENCE)
    tried.add("a cohort whose scheduler is killed", "refused")
    assert status == 2, errors
    assert "the scheduler was lost" in errors
    assert "Traceback" not in errors
    status, _, errors = ended(started("cohort", study, "--out", out, "--quiet"), timeout=PATIENCE)
    assert status == 1, errors
    same(study, out)


@pytest.mark.long
def test_a_worker_that_is_killed_before_it_begins_is_one_error(study, tmp_path, tried):
    def workers(process):
        commands = [Path(f"/proc/{one}/cmdline") for one in children(process.pid)]
        return [one.parent.name for one in commands if one.is_file() and "spawn_main" in one.read_text()]

    process = started("cohort", study, "--out", tmp_path / "out", "--workers", "2", "--quiet")
    wait_for(lambda: workers(process) or process.poll() is not None)
    os.kill(int(workers(process)[0]), signal.SIGKILL)
    status, _, errors = ended(process, timeout=PATIENCE)
    tried.add("a cohort, a worker killed before it begins", "refused")
    assert status == 2, errors
    assert errors.startswith("error: a worker was lost before it began")
    assert len(errors.splitlines()) == 1


@pytest.mark.long
def test_random_kills_of_all_processes_leave_the_same_table(study, tmp_path, tried):
    """20 kill -9 of the client or of one of its workers, at random moments; then it runs to its end."""
    rng, out = random.Random(20261122), tmp_path / "out"
    command = ("cohort", study, "--out", out, "--workers", "2", "--quiet")
    kills = 0
    while kills < 20:
        process = started(*command)
        deadline = time.monotonic() + rng.uniform(1.0, 15.0)
        while time.monotonic() < deadline and process.poll() is None:
            time.sleep(0.05)
        victims = [process.pid, *children(process.pid)]
        try:
            os.kill(rng.choice(victims), signal.SIGKILL)
            kills += 1
            tried.add("a cohort, the client or a worker killed at random", "used")
        except ProcessLookupError:
            pass
        if rng.random() < 0.6:
            process.kill()
        ended(process, timeout=300.0)
        if (out / "cohort.csv").is_file():
            same_tables(study, out)  # the lock of one that was killed at its end is still there
            for part in list(out.glob("parts/*/*/*/*/*.npz"))[:3]:
                part.unlink()
    status, _, errors = ended(started(*command), timeout=300.0)
    assert status == 1, errors
    same(study, out)
