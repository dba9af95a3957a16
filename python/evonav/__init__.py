"""EvoNav-Bench: lifelong navigation in homes that change.

Names are imported when they are first used, so that the package starts fast; `__init__.pyi` says where they are.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
