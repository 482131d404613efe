//! Frames of an animation and their motion vectors, against closed forms.

use apr::io::{FrameHeader, Picture, ReadOptions, write_frame};
use apr::trace::{AnimationFrame, RenderOptions, render};
use apr::{Frame, Motion};
use serde_json::{Value, json};

use super::parse;

/// Columns, rows and field of view; the plane z = 0 is 4 before the camera.
const SIZE: [usize; 2] = [20, 12];
const FOV: f64 = 90.0;
const DISTANCE: f32 = 4.0;

/// A wall that fills the picture.
fn wall() -> Value {
    json!({
        "camera": {"origin": [0, 0, DISTANCE], "target": [0, 0, 0], "fov": FOV, "resolution": SIZE},
        "materials": {"gray": {"type": "diffuse", "reflectance": 0.5}},
        "shapes": [{"type": "rectangle", "material": "gray", "transform": [{"scale": 30}]}],
        "environment": {"type": "constant", "radiance": 1}
    })
}

fn frame_of(scene: &Value, number: u32, count: u32, shutter: f32) -> Frame {
    let frame = Some(AnimationFrame::new(number, count, shutter).unwrap());
    render(&parse(scene), &RenderOptions { spp: 4, frame, ..RenderOptions::default() }).unwrap().frame
}

/// Expects the same vectors in every pixel, up to `tolerance`.
fn expect(motion: &Motion, previous: [f32; 2], next: [f32; 2], tolerance: f32) {
    let all = [(&motion.previous, previous), (&motion.next, next)];
    for (planes, expected) in all {
        for (plane, expected) in planes.as_ref().unwrap().iter().zip(expected) {
            for value in plane.data() {
                assert!((value - expected).abs() < tolerance, "{value} where {expected} was expected");
            }
        }
    }
}

/// Pixels that a way across the line of sight has at the wall's distance.
fn pixels(way: f32) -> f32 {
    way / DISTANCE * SIZE[0] as f32 / 2.0
}

#[test]
fn a_camera_that_moves_aside_sees_the_wall_move_the_other_way() {
    let mut scene = wall();
    scene["camera"]["end"] = json!({"origin": [2, 1, DISTANCE], "target": [2, 1, 0]});
    let way = [pixels(2.0 / 5.0), -pixels(1.0 / 5.0)]; // right; up is towards smaller rows
    for (number, shutter) in [(1, 0.0), (3, 0.0), (3, 1.0), (5, 0.5)] {
        let frame = frame_of(&scene, number, 5, shutter);
        expect(frame.motion().unwrap(), way, way.map(|v| -v), 1e-3);
    }
}

#[test]
fn a_wall_that_moves_takes_its_vectors_along_and_a_still_scene_has_none() {
    let mut scene = wall();
    expect(frame_of(&scene, 2, 3, 0.5).motion().unwrap(), [0.0; 2], [0.0; 2], 1e-5);
    scene["shapes"][0]["motion"] = json!([{"scale": 30}, {"translate": [-1, 0.5, 0]}]);
    let way = [-pixels(1.0 / 4.0), -pixels(0.5 / 4.0)];
    expect(frame_of(&scene, 2, 4, 0.5).motion().unwrap(), way.map(|v| -v), way, 1e-3);
}

#[test]
fn the_background_moves_as_the_camera_turns() {
    let mut scene = wall();
    scene["camera"]["target"] = json!([0, 0, 9]);
    scene["camera"]["end"] = json!({"origin": [5, 0, DISTANCE], "target": [5, 0, 9]});
    expect(frame_of(&scene, 1, 2, 0.5).motion().unwrap(), [0.0; 2], [0.0; 2], 1e-4);
    scene["camera"]["end"] = json!({"origin": [0, 0, DISTANCE], "target": [-0.05, 0, 9]});
    let frame = frame_of(&scene, 1, 1, 0.0);
    let motion = frame.motion().unwrap().next.as_ref().unwrap()[0].get(10, 6);
    // Back to back with the wall, right is towards −x: the camera turns right, the picture moves left.
    assert!((motion + 0.05 / 5.0 * 10.0).abs() < 0.02, "{motion}");
}

#[test]
fn frames_are_pieces_of_the_motion_with_noise_of_their_own() {
    let mut scene = wall();
    let still = [frame_of(&scene, 1, 2, 1.0), frame_of(&scene, 2, 2, 1.0)];
    assert_ne!(still[0].features()[2].planes, still[1].features()[2].planes, "positions within the pixels");
    // A half of the way, frozen, is where frame 2 of 2 begins.
    scene["camera"]["end"] = json!({"origin": [2, 0, DISTANCE], "target": [2, 0, 0]});
    let position = |frame: &Frame| frame.features()[2].planes[0].get(10, 6);
    let second = frame_of(&scene, 2, 2, 0.0);
    assert!((position(&second) - 1.0).abs() < DISTANCE / 10.0, "{}", position(&second));
    for (number, count, shutter) in [(0, 2, 0.5), (3, 2, 0.5), (1, 2, 1.5), (1, 2, f32::NAN)] {
        assert!(AnimationFrame::new(number, count, shutter).is_err());
    }
}

#[test]
fn motion_is_written_and_read_again() {
    let mut scene = wall();
    scene["camera"]["end"] = json!({"origin": [2, 1, DISTANCE], "target": [2, 1, 0]});
    let frame = frame_of(&scene, 2, 4, 0.5);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    write_frame(&path, &frame, &FrameHeader::default()).unwrap();
    let options = ReadOptions { motion: true, ..ReadOptions::default() };
    assert_eq!(Picture::read(&path, &options).unwrap().frame().motion(), frame.motion());
    assert_eq!(Picture::read(&path, &ReadOptions::default()).unwrap().frame().motion(), None);
}
