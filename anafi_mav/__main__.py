"""`python -m anafi_mav` is `anafi-mav`."""

import sys

from anafi_mav.cli import main

if __name__ == "__main__":
    sys.exit(main())
