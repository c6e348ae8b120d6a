//! The watcher reports contents that changed, however an editor writes them, and nothing else.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use manylight_gpu::{WatchSet, Watcher};

const SOON: Duration = Duration::from_secs(5);
const NEVER: Duration = Duration::from_millis(400);

fn file(dir: &Path) -> PathBuf {
    let path = dir.join("node.wgsl");
    fs::write(&path, "one").unwrap();
    path
}

fn watch_file(path: &Path) -> Watcher {
    Watcher::new(WatchSet { files: vec![path.to_owned()], ..Default::default() }).unwrap()
}

#[test]
fn a_write_is_reported_once_and_a_touch_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path());
    let mut watcher = watch_file(&path);
    assert!(watcher.poll().is_empty());
    fs::write(&path, "two").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path.as_path()]);
    fs::write(&path, "two").unwrap();
    assert!(watcher.recv_timeout(NEVER).is_empty());
}

#[test]
fn editors_that_rename_are_followed() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path());
    let mut watcher = watch_file(&path);
    for text in ["two", "three"] {
        let other = dir.path().join("4913");
        fs::write(&other, text).unwrap();
        fs::rename(&path, dir.path().join("node.wgsl~")).unwrap();
        fs::rename(&other, &path).unwrap();
        assert_eq!(watcher.recv_timeout(SOON), [path.as_path()], "{text}");
    }
}

#[test]
fn deletion_and_return_are_reported() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path());
    let mut watcher = watch_file(&path);
    fs::remove_file(&path).unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path.as_path()]);
    fs::write(&path, "one").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path.as_path()]);
    fs::remove_file(&path).unwrap();
    fs::write(&path, "one").unwrap();
    assert!(watcher.recv_timeout(NEVER).is_empty(), "it is back before anybody looked, and the same");
}

#[test]
fn a_half_written_file_is_reported_again_when_it_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path());
    let mut watcher = watch_file(&path);
    fs::write(&path, "ha").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path.as_path()]);
    fs::write(&path, "half no more").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path]);
}

#[test]
fn folders_report_new_files_below_them_by_extension() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("shaders");
    fs::create_dir_all(folder.join("a")).unwrap();
    let set = WatchSet { folders: vec![folder.clone()], extensions: vec!["wgsl".into(), "ron".into()], ..Default::default() };
    let mut watcher = Watcher::new(set).unwrap();
    fs::write(folder.join("a/x.txt"), "no").unwrap();
    fs::write(folder.join("a/.x.wgsl.swp"), "no").unwrap();
    assert!(watcher.recv_timeout(NEVER).is_empty());
    fs::write(folder.join("a/x.wgsl"), "yes").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [folder.join("a/x.wgsl")]);
    fs::create_dir(folder.join("b")).unwrap();
    fs::write(folder.join("b/y.ron"), "yes").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [folder.join("b/y.ron")]);
}

#[test]
fn a_folder_that_is_replaced_is_followed() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("shaders");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("x.wgsl"), "one").unwrap();
    let mut watcher = Watcher::new(WatchSet { folders: vec![folder.clone()], ..Default::default() }).unwrap();
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [folder.join("x.wgsl")]);
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("x.wgsl"), "two").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [folder.join("x.wgsl")]);
    fs::write(folder.join("x.wgsl"), "three").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [folder.join("x.wgsl")]);
}

#[test]
fn files_that_do_not_exist_yet_can_be_watched() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("later/on.ron");
    let mut watcher = watch_file(&path);
    fs::create_dir(dir.path().join("later")).unwrap();
    fs::write(&path, "now").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path.as_path()]);
    fs::write(&path, "again").unwrap();
    assert_eq!(watcher.recv_timeout(SOON), [path]);
}

#[test]
fn a_new_set_keeps_what_was_known() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path());
    let other = dir.path().join("other.ron");
    let mut watcher = watch_file(&path);
    fs::write(&path, "two").unwrap();
    watcher.set(WatchSet { files: vec![path.clone(), other.clone()], ..Default::default() }).unwrap();
    fs::write(&other, "new").unwrap();
    let mut changed = watcher.recv_timeout(SOON);
    while changed.len() < 2 {
        let more = watcher.recv_timeout(SOON);
        assert!(!more.is_empty(), "only {changed:?}");
        changed.extend(more);
    }
    assert_eq!(changed, [path, other]);
}
