"""Exports a run directory or a tlog to MCAP, CSV, Parquet or ULog.

::

    run directory ─ run ──┬─ scene, series ─────────────────┐
                          │                                 ├─ mcap_export ── mcap_file ─── flight.mcap
    tlog ─────── log ─────┼─ mavlink_json ──────────────────┘
                          ├─ motion_tables, mavlink_tables ─── table_export ─ table_files ─ NAME.csv, .parquet
                          └─ px4_topics ────────────────────── ulog_export ── ulog_file ─── vehicle-N.ulg

Messages are decoded by the field definitions of the dialect (``dialect``). Sources are iterators, so that
memory does not grow with the log; the sources of an MCAP are merged in order of time.
"""
