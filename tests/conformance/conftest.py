"""Makes the small plugins of `spoiled/` importable: components name them as "spoiled.material:Ciarlet"."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
