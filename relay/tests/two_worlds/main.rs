//! Two iceoryx2 worlds on one machine, an executor in the one and planners in the other, and the two
//! ends of a relay between them, as processes.

mod carried;
mod cuts;
mod namespaces;
mod proxy;
mod refused;
mod rig;
mod secured;
