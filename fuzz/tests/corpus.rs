//! The committed corpus through all targets, so that what was found once stays found.

use std::{fs, path::Path};

use mtj_fuzz::TARGETS;

#[test]
fn no_target_breaks_on_anything_in_its_corpus() {
    for (name, target) in TARGETS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
        let mut count = 0;
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let data = fs::read(&path).unwrap();
            eprintln!("{}", path.display());
            target(&data);
            // Cut short, it is another input, and often the worse one.
            target(&data[..data.len() / 2]);
            count += 1;
        }
        assert!(count >= 4, "{name}: a corpus of {count} is none");
    }
}

#[test]
fn every_target_has_a_program_and_is_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = fs::read_to_string(root.join("run")).unwrap();
    for (name, _) in TARGETS {
        assert!(root.join(format!("fuzz_targets/{name}.rs")).exists(), "{name}");
        assert!(script.contains("targets=(") && script.contains(name), "{name}");
    }
}
