//! The Python package: its wheel is built, installed into a folder of its own, and tried beside the binary, NumPy, pandas, polars,
//! pyarrow and mypy.

use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{file, muprime, python, texts};

/// The folder that the wheel is unpacked into.
fn installed(folder: &Path) -> PathBuf {
    let (wheels, site) = (folder.join("wheels"), folder.join("site"));
    let maturin = PathBuf::from(python().get_program()).with_file_name("maturin");
    let mut build = Command::new(maturin);
    build.args(["build", "--release", "--quiet", "-m"]).arg(file("python/Cargo.toml")).arg("-i");
    build.arg(python().get_program()).arg("-o").arg(&wheels);
    // The same profile and folder as everything else: what is built stays built.
    build.env("CARGO_TARGET_DIR", file("target"));
    let built = build.output().expect("maturin is missing: tests/venv installs it");
    assert!(built.status.success(), "{}", texts(&built).1);
    let found: Vec<PathBuf> = std::fs::read_dir(&wheels).unwrap().map(|e| e.unwrap().path()).collect();
    let [wheel] = &found[..] else { panic!("{found:?}") };
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.contains("-cp311-abi3-"), "one wheel for every Python from 3.11 on: {name}");
    println!("{name}: {:.1} MB", std::fs::metadata(wheel).unwrap().len() as f64 / 1e6);
    let mut install = python();
    install.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--no-index",
        "--target",
    ]);
    let done = install.arg(&site).arg(wheel).output().unwrap();
    assert!(done.status.success(), "{}", texts(&done).1);
    site
}

#[test]
fn the_package_says_what_the_command_says() {
    let folder = tempfile::tempdir().unwrap();
    let site = installed(folder.path());
    let tried = python()
        .arg(file("tests/python/package.py"))
        .arg(muprime().get_program())
        .arg(folder.path())
        .env("PYTHONPATH", &site)
        .env("MUPRIME_RUNS", folder.path())
        .output()
        .unwrap();
    let (out, err) = texts(&tried);
    println!("{out}");
    assert!(tried.status.success() && out.ends_with("ok\n"), "{out}{err}");

    // A laboratory's own controller, in pymodbus, tested against the virtual rig by way of the pytest plugin.
    let foreign = python()
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
        .arg(file("tests/python/test_foreign_controller.py"))
        .env("PYTHONPATH", &site)
        .env("MUPRIME_BINARY", muprime().get_program())
        .current_dir(folder.path())
        .output()
        .unwrap();
    let (out, err) = texts(&foreign);
    assert!(foreign.status.success() && out.contains("4 passed"), "{out}{err}");

    // Types: the package itself, and what its users write.
    let checked = python()
        .args(["-m", "mypy", "--strict", "--no-incremental", "--python-executable"])
        .arg(python().get_program())
        .arg(site.join("muprime"))
        .arg(file("tests/python/typed.py"))
        .env("MYPYPATH", &site)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(checked.status.success(), "{}{}", texts(&checked).0, texts(&checked).1);
}
