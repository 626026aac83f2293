"""The command ``python -m sidegan.run``."""

import sys

from sidegan.pipeline.run import main

if __name__ == "__main__":
    sys.exit(main())
