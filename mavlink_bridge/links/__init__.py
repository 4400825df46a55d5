"""Links for datagrams between processes, which never wait.

endpoint string → endpoints → opening → a link: udp, tcp, serial_port, replay, or link's pair in memory. Byte
streams are cut into frames by stream and streams.
"""
