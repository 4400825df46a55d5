"""Runs and logs as files of other people's tools: MCAP, CSV, Parquet, ULog.

::

    run directory ─ run ──┬─ scene, series ─────────────────┐
                          │                                 ├─ mcap_export ── mcap_file ─── flight.mcap
    tlog ─────── log ─────┼─ mavlink_json ──────────────────┘
                          ├─ motion_tables, mavlink_tables ─── table_export ─ table_files ─ NAME.csv, .parquet
                          └─ px4_topics ────────────────────── ulog_export ── ulog_file ─── vehicle-N.ulg

A message is read by what the dialect says of it (``dialect``). Sources are iterators, so that memory does not
grow with a log; those of an MCAP are merged in the order of time.
"""
