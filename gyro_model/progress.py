"""What long work is told to call as it goes on."""

from collections.abc import Callable

Progress = Callable[[float, float], None]
"""Takes what is done and the whole, in one unit."""
Steps = Callable[[str], None]
"""Takes what is being done, in words."""
