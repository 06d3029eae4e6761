"""What several rooms' tests share."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.threads import use_one_thread
import pytest

use_one_thread()

KTH = Path(__file__).resolve().parents[2] / 'shared' / 'data' / 'kth_handovers'


@pytest.fixture(scope='session')
def kth_folder() -> Path:
    """Folder of the recorded handovers between people; the test skips where it is absent."""
    if not (KTH / 'trials.csv').is_file():
        pytest.skip('recordings of people not available')
    return KTH
