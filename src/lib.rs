//! Close a robot's control loop over a bus, and study what sample period and latency do to it.
