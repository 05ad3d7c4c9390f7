"""One parallel kernel at a time.

Numba's plain thread pool aborts the process when two Python threads launch parallel kernels at once, so whoever
launches one (`with ONE_LAUNCH:`) holds this lock. A kernel may launch no other inside.
"""

import threading

ONE_LAUNCH = threading.Lock()
