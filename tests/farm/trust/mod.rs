//! Farms of several machines: TLS, tokens, certificates, roles. What is on another machine is played by processes
//! with a state folder of their own that dial an address which is not loopback.

mod hostile;
mod joining;
mod roles;
mod users;
