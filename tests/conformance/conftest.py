"""Makes the small plugins of `broken/` importable: components name them as "broken.material:Ciarlet"."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
