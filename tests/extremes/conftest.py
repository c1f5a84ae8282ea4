"""Every case of the extremes is counted, with its worst error, in a table for the documentation."""

from pathlib import Path

import pytest
from outcomes import Ledger

HERE = Path(__file__).parent
LEDGER = pytest.StashKey[Ledger]()

#: Hypothesis draws from this seed, so that a run can be repeated; --hypothesis-seed gives another one.
SEED = 20210615


def pytest_configure(config):
    chosen = config.getoption("hypothesis_seed", None)
    seed = SEED if chosen is None else int(chosen)
    config.stash[LEDGER] = Ledger(long=config.getoption("long"), seed=seed)


def pytest_collection_modifyitems(items):
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.extremes)


@pytest.fixture(scope="session")
def ledger(request):
    """Where the outcome of each case goes."""
    return request.config.stash[LEDGER]


@pytest.fixture(scope="session")
def long(request):
    """Whether the long form was asked for."""
    return request.config.getoption("long")


def pytest_terminal_summary(terminalreporter, config):
    ledger = config.stash.get(LEDGER, None)
    if ledger is not None and ledger.rows:
        terminalreporter.write_line(f"extremes: {ledger.count} cases, seed {ledger.seed}")


def pytest_sessionfinish(session, exitstatus):
    path = session.config.getoption("extremes_table")
    if path is not None and exitstatus == 0:
        session.config.stash[LEDGER].write(Path(path))
