"""`python -m handover_dmp` is the `handover_dmp` command."""

import sys

from handover_dmp.cli.main import main

if __name__ == '__main__':
    sys.exit(main())
