"""Tasks on disk: public and oracle parts, apart.

Names are imported when they are first used, so that who needs the public part alone, such as an agent in a process of
its own, loads nothing of the oracle.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
