"""The command ``python -m sidegan.untracked``."""

import sys

from sidegan.pipeline.untracked import main

if __name__ == "__main__":
    sys.exit(main())
