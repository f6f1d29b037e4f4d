"""Pictures and films of a robot, the interactive window, and fields for ParaView."""
