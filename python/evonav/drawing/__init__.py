"""Draw floor plans from above as SVG: houses, maps of cells, object entries and paths.

Names are imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
