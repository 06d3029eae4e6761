"""The `handover_dmp` command: parses, calls, prints; one file a verb, imported when it is used."""

from handover_dmp.threads import use_one_thread

use_one_thread()
