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
    let rival = serde_json::json!([{ "name": "<perfect>", "input": render, "picture": reference }]);
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
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

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
    assert!(folder.join("report/time-gallery-spp16.svg").exists());
}
