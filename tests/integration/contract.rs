//! Exit statuses and streams of the command line.

use crate::support::program;

#[test]
fn wrong_usage_is_status_two() {
    let status = program().arg("no-such-command").output().unwrap().status;
    assert_eq!(status.code(), Some(2));
}
