"""Which of several sources of velocity commands drives: priorities, timeouts and locks, as twist_mux has them."""
