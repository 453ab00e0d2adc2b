//! The Python package, installed into a folder of its own and tried beside the binary, NumPy, pandas, polars,
//! pyarrow and mypy.

use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{file, muprime, python, texts};

/// A folder with the package as a wheel has it: the library that the workspace's build made beside the Python files. `MUPRIME_WHEEL=1` has maturin
/// build a real wheel and pip install it, which compiles everything once more.
fn installed(folder: &Path) -> PathBuf {
    let site = folder.join("site");
    if std::env::var_os("MUPRIME_WHEEL").is_some() {
        wheel(folder, &site);
        return site;
    }
    let package = site.join("muprime");
    std::fs::create_dir_all(&package).unwrap();
    for entry in std::fs::read_dir(file("python/muprime")).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_file() {
            std::fs::copy(entry.path(), package.join(entry.file_name())).unwrap();
        }
    }
    let library = PathBuf::from(muprime().get_program()).with_file_name("lib_muprime.so");
    assert!(library.exists(), "{} is missing: cargo build --release --workspace", library.display());
    std::fs::copy(library, package.join("_muprime.abi3.so")).unwrap();
    site
}

/// Builds the wheel and installs it.
fn wheel(folder: &Path, site: &Path) {
    let wheels = folder.join("wheels");
    let maturin = PathBuf::from(python().get_program()).with_file_name("maturin");
    let mut build = Command::new(maturin);
    build.args(["build", "--release", "--quiet", "-m"]).arg(file("python/Cargo.toml")).arg("-i");
    build.arg(python().get_program()).arg("-o").arg(&wheels);
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
    ]);
    let done = install.arg("--target").arg(site).arg(wheel).output().unwrap();
    assert!(done.status.success(), "{}", texts(&done).1);
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

    // A law that is a Python function, led through table, run and verdict.
    let own = python()
        .arg(file("tests/python/own_law.py"))
        .arg(muprime().get_program())
        .arg(folder.path())
        .env("PYTHONPATH", &site)
        .output()
        .unwrap();
    let (out, err) = texts(&own);
    println!("{out}");
    assert!(own.status.success() && out.ends_with("ok\n"), "{out}{err}");

    // A laboratory's own controller, in pymodbus, tested against the virtual rig by way of the pytest plugin.
    let foreign = python()
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "muprime.testing"])
        .arg(file("tests/python/test_foreign_controller.py"))
        .env("PYTHONPATH", &site)
        .env("MUPRIME_BINARY", muprime().get_program())
        .current_dir(folder.path())
        .output()
        .unwrap();
    let (out, err) = texts(&foreign);
    assert!(foreign.status.success() && out.contains("4 passed"), "{out}{err}");

    // The notebooks, with a real kernel; their outputs are compared with the stored ones.
    let notebooks = python()
        .arg(file("tests/python/notebooks.py"))
        .arg(file("python/notebooks"))
        .arg(folder.path().join("notebooks"))
        .args(std::env::var_os("MUPRIME_UPDATE").map(|_| "--update"))
        .env("PYTHONPATH", &site)
        .output()
        .unwrap();
    let (out, err) = texts(&notebooks);
    println!("{out}");
    assert!(notebooks.status.success() && out.ends_with("ok\n"), "{out}{err}");

    // A rendered target beside scipy.
    let rendering = python()
        .arg(file("tests/python/rendering.py"))
        .arg(folder.path())
        .env("PYTHONPATH", &site)
        .output()
        .unwrap();
    let (out, err) = texts(&rendering);
    println!("{out}");
    assert!(rendering.status.success() && out.ends_with("ok\n"), "{out}{err}");

    // bluesky's RunEngine, and scikit-learn's own checks.
    let ecosystem = python()
        .arg(file("tests/python/ecosystem.py"))
        .arg(folder.path())
        .env("PYTHONPATH", &site)
        .env("MUPRIME_BINARY", muprime().get_program())
        .env("MUPRIME_RUNS", folder.path())
        .output()
        .unwrap();
    let (out, err) = texts(&ecosystem);
    println!("{out}");
    assert!(ecosystem.status.success() && out.ends_with("ok\n"), "{out}{err}");

    // A study by executors of Python.
    let studies = python()
        .arg(file("tests/python/studies.py"))
        .arg(muprime().get_program())
        .arg(folder.path())
        .env("PYTHONPATH", &site)
        .env("MUPRIME_BINARY", muprime().get_program())
        .output()
        .unwrap();
    let (out, err) = texts(&studies);
    assert!(studies.status.success() && out.ends_with("ok\n"), "{out}{err}");

    // Types, by two checkers: the package itself, and what its users write.
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
    let config = r#"{"typeCheckingMode": "standard", "extraPaths": ["site"], "include": ["site/muprime", "typed.py"]}"#;
    std::fs::write(folder.path().join("pyrightconfig.json"), config).unwrap();
    std::fs::copy(file("tests/python/typed.py"), folder.path().join("typed.py")).unwrap();
    let checked = python()
        .args(["-m", "basedpyright", "--level", "error", "--pythonpath"])
        .arg(python().get_program())
        .current_dir(folder.path())
        .output()
        .unwrap();
    let (out, err) = texts(&checked);
    assert!(checked.status.success() && out.contains("0 errors"), "{out}{err}");
}
