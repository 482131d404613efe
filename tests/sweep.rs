//! `apr-compare sweep` on a bundled render: the page is complete and the figures are in the JSON.

use std::path::Path;
use std::process::Command;

#[test]
fn one_page_holds_every_run_and_needs_nothing_else() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("sweep");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/mitsuba");
    let (render, reference) = (fixtures.join("gallery_spp16.exr"), fixtures.join("gallery_ref.exr"));
    let variants = folder.join("variants.json");
    std::fs::write(&variants, r#"[{"name": "as it comes"}]"#).unwrap();
    let rivals = folder.join("rivals.json");
    let again = fixtures.join(".").join("..").join("mitsuba/gallery_spp16.exr");
    let rival = serde_json::json!([
        { "name": "<perfect>", "input": again, "picture": reference },
        { "name": "stranger", "input": "elsewhere.exr", "picture": "none.exr" },
    ]);
    std::fs::write(&rivals, rival.to_string()).unwrap();

    let output = Command::new(env!("CARGO_BIN_EXE_apr-compare"))
        .arg("sweep")
        .arg(&render)
        .args(["--sample-seconds", "0.1", "--reference"])
        .arg(&reference)
        .arg("--out")
        .arg(folder.join("report"))
        .arg("--variants")
        .arg(&variants)
        .arg("--rivals")
        .arg(&rivals)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let note = "rivals.json: rival 'stranger' is left out: its input elsewhere.exr is none of this sweep's";
    assert!(said.contains(note) && !said.contains("<perfect>"), "{said}");

    let json = std::fs::read_to_string(folder.join("report/sweep.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let input = &json["inputs"][0];
    assert_eq!((&input["name"], &input["spp"]), (&"gallery_spp16".into(), &16.0.into()));
    assert!(json["reference_noise"].as_f64().unwrap() < 0.1 * input["noisy"]["rel_mse"].as_f64().unwrap());
    assert!(input["runs"][0]["seconds"].as_f64().unwrap() > 0.0);
    assert_eq!(input["runs"][1]["scores"]["rel_mse"], 0.0);

    let page = std::fs::read_to_string(folder.join("report/index.html")).unwrap();
    assert!(!page.contains("{{") && page.contains("&lt;perfect&gt;") && !page.contains("<perfect>:"));
    let outside = ["<link", "@import", "src=\"http", "href=", "fetch("];
    assert!(outside.iter().all(|needle| !page.contains(needle)));
    for picture in ["reference", "noisy", "as-it-comes--signed-error", "as-it-comes--order", "-perfect-"] {
        let path = folder.join(format!("report/pictures/gallery-spp16-{picture}.png"));
        assert_eq!(image::image_dimensions(path).unwrap(), (128, 96));
    }
    // All of it may be replaced by the next run.
    let written = |folder: &Path| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = written(&folder.join("report")).chain(written(&folder.join("report/pictures")));
    let files: Vec<_> = files.filter(|path| path.is_file()).collect();
    assert!(files.contains(&folder.join("report/time-gallery-spp16.svg")));
    for file in files {
        assert!(apr::report::is_own(&std::fs::read(&file).unwrap()), "{}", file.display());
    }
}

/// Before any work: neither the render nor its reference is there.
#[test]
fn a_page_that_would_replace_what_it_is_made_of_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let variants = folder.path().join("sweep.json");
    std::fs::write(&variants, r#"[{"name": "as it comes"}]"#).unwrap();
    let sweep = |inputs: &[&str], out: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_apr-compare"));
        command.arg("sweep").args(inputs).args(["--reference", "none.exr", "--variants"]).arg(&variants);
        let output = command.arg("--out").arg(out).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, said) = sweep(&["a.exr"], folder.path());
    assert!(code == Some(2) && said.contains("sweep.json: is an input as well as a result"), "{said}");
    let (code, said) = sweep(&["a b.exr", "a-b.exr"], &folder.path().join("page"));
    assert!(code == Some(2) && said.contains("time-a-b.svg: several results"), "{said}");
    let (code, said) = sweep(&["a.exr", "b.exr", "./a.exr"], &folder.path().join("page"));
    assert!(code == Some(2) && said.contains("./a.exr: is given twice among the inputs"), "{said}");
    // Nor may the pictures of two variants, or of a variant and the render, have one name.
    for [a, b] in [["b!", "b?"], ["twice", "twice"], ["plain", "noisy"]] {
        std::fs::write(&variants, format!(r#"[{{"name": "{a}"}}, {{"name": "{b}"}}]"#)).unwrap();
        let (code, said) = sweep(&["a.exr"], &folder.path().join("page"));
        assert!(code == Some(2) && said.contains(&format!("the picture of '{b}'")), "{said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Before any work: neither the render nor its reference is there.
#[test]
fn what_others_wrote_in_the_folder_is_replaced_only_when_told_to() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    for name in ["index.html", "sweep.json", "samples.svg", "time-a.svg", "pictures/a-noisy.png"] {
        let file = folder.path().join(name);
        std::fs::write(&file, "{}").unwrap();
        let sweep = |more: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_apr-compare"));
            command
                .args(["sweep", "a.exr", "--reference", "none.exr", "--out"])
                .arg(folder.path())
                .args(more);
            let output = command.output().unwrap();
            (output.status.code(), String::from_utf8(output.stderr).unwrap())
        };
        let (code, said) = sweep(&[]);
        assert!(code == Some(2) && said.contains(&format!("{name}: is there already")), "{said}");
        assert_eq!(sweep(&["--overwrite"]).0, Some(3), "goes on to read the reference");
        std::fs::remove_file(file).unwrap();
    }
}

/// Before any work: the reference is not there either.
#[test]
fn a_folder_that_takes_no_page_and_senseless_numbers_are_told_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let code = |further: [&str; 2]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_apr-compare"));
        command.args(["sweep", "a.exr", "--reference", "none.exr"]).args(further);
        command.current_dir(folder.path()).output().unwrap().status.code()
    };
    assert_eq!(code(["--out", "file/page"]), Some(2));
    for number in ["0", "NaN", "-1", "inf"] {
        assert_eq!(code(["--sample-seconds", number]), Some(2), "{number}");
        assert_eq!(code(["--spp", number]), Some(2), "{number}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
