"""Tasks on disk, with public and oracle parts in separate files.

Names are imported on first use. A program that needs the public part alone, such as an agent in a process of its own,
loads nothing of the oracle.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
