from ._core import __version__
from .errors import EvonavError
from .evaluation.contract.check import check_agent
from .report.notebook import load

__all__ = ["EvonavError", "__version__", "check_agent", "load"]
