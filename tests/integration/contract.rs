//! Exit statuses and streams of the command line.

use assert_cmd::Command;

#[test]
fn wrong_usage_is_status_two() {
    Command::cargo_bin("lobestone")
        .unwrap()
        .arg("no-such-command")
        .assert()
        .code(2);
}
