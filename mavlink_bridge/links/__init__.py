"""Ways for datagrams between processes.

endpoint string → endpoints → opening → a link: udp, tcp, serial_port, replay, or link's pair in memory. What
is a stream below is cut into frames by stream and streams.
"""
