"""The `handover_dmp` command: parses, calls, prints; one file a verb, imported when it is used."""
