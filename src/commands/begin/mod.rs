//! Begin: demo, inspect, init, serve.

pub(crate) mod bench_worker;
pub(crate) mod demo;
pub(crate) mod entrance;
pub(crate) mod init;
pub(crate) mod init_robot;
pub(crate) mod inspect;
pub(crate) mod serve;
pub(crate) mod workbench;
