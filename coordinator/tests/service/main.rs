//! The coordinator's services over real sockets on loopback, with workers that deliver values made
//! up from the numbers of their units.

mod guard;
mod jobs;
mod limits;
mod protocol;
mod refusals;
mod sessions;
mod site;
mod worker;
