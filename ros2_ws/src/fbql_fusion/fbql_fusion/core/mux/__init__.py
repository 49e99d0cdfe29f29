"""Which of several sources of velocity commands drives: priorities, timeouts and locks, as in twist_mux."""
