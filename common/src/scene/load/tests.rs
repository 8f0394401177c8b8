//! Whole scenes through the reader, good and bad.

use proptest::prelude::*;

use super::*;
use crate::scene::files::{Gathered, Pack};
use crate::scene::{Environment, Surface};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

const LIBRARY: &str = "newmtl white\nKd .8 .8 .8\nnewmtl lamp\nKe 5 5 5\nnewmtl brick\n\
                       Kd 1 1 1\nmap_Kd brick.png\n";

fn pack(files: &[(&str, &str)]) -> Pack {
    let owned = files.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()));
    Pack::from_files(owned).unwrap()
}

fn scene(obj: &str, rest: &str) -> Result<Loaded, SceneError> {
    let json = format!(
        "{{\"equilux\": 1, \"models\": [{{\"file\": \"m/a.obj\"}}],\n\
         \"camera\": {{\"eye\": [0, 0, 5], \"target\": [0, 0, 0]}}{rest}}}"
    );
    let obj = format!("{TRIANGLE}{obj}");
    load(&pack(&[("s.json", &json), ("m/a.obj", &obj), ("m/a.mtl", LIBRARY)]), "s.json")
}

fn message(result: Result<Loaded, SceneError>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn a_scene_is_put_together_from_its_files() {
    let obj = "mtllib a.mtl\no floor\nusemtl white\nf 1 2 3\no light\nusemtl lamp\nf 1 2 3\n\
               usemtl white\nf 3 2 1\n";
    let loaded = scene(obj, ", \"cameras\": {\"side\": {\"eye\": [9,0,0], \"target\": [0,0,0]}}");
    let loaded = loaded.unwrap();
    assert_eq!(loaded.scene.geometry.objects.len(), 2);
    assert_eq!(loaded.light_object_count, 1);
    assert_eq!(loaded.scene.tables.materials.len(), 2, "what nothing uses is not there");
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_eq!(camera_named(&loaded.cameras, "side").unwrap().eye, [9.0, 0.0, 0.0]);
    let error = camera_named(&loaded.cameras, "sied").unwrap_err().to_string();
    assert!(error.contains("there is no camera \"sied\"; did you mean \"side\"?"), "{error}");
}

#[test]
fn a_model_alone_gets_a_camera_and_a_sky() {
    let loaded = load(&pack(&[("a.obj", &format!("{TRIANGLE}f 1 2 3"))]), "a.obj").unwrap();
    assert!(matches!(loaded.scene.tables.environment, Environment::Constant { .. }));
    assert_eq!(loaded.camera.target, [0.5, 0.5, 0.0]);
    let lit = format!("mtllib a.mtl\n{TRIANGLE}usemtl lamp\nf 1 2 3");
    let loaded = load(&pack(&[("a.obj", &lit), ("a.mtl", LIBRARY)]), "a.obj").unwrap();
    assert_eq!(loaded.scene.tables.environment, Environment::Black);
}

#[test]
fn materials_without_a_library_are_grey_with_a_warning() {
    let loaded = scene("usemtl wood\nf 1 2 3\n", "").unwrap();
    let warnings = loaded.warnings.join("\n");
    assert!(warnings.contains("m/a.obj:4: material \"wood\" is in no material library"));
    assert!(warnings.contains("there is no light"));
    assert_eq!(loaded.scene.tables.materials[0].name, "wood");
}

#[test]
fn overrides_change_materials_by_name() {
    let obj = "mtllib a.mtl\nusemtl brick\nf 1 2 3\n";
    let mirror = ", \"materials\": {\"brick\": {\"type\": \"mirror\"}}";
    let loaded = scene(obj, mirror).unwrap();
    assert!(matches!(loaded.scene.tables.materials[0].surface, Surface::Mirror { .. }));
    assert!(loaded.scene.tables.textures.is_empty(), "the texture that it had is not needed");
    let obj = obj.replace("brick", "white");
    let error = message(scene(&obj, ",\n\"materials\": {\n\"brik\": {\"opacity\": 1}}"));
    assert_eq!(error, "s.json:4: there is no material \"brik\"; did you mean \"brick\"?");
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                   property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                   end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

fn placed(model: &str, rest: &str) -> Result<Loaded, SceneError> {
    let json = format!(
        "{{\"equilux\": 1, \"camera\": {{\"eye\": [0, 0, 5], \"target\": [0, 0, 0]}},\n\
         \"models\": [{model}]{rest}}}"
    );
    let obj = format!("mtllib a.mtl\n{TRIANGLE}f 1 2 3\nusemtl white\nf 1 2 3\n");
    let files = [("s.json", json.as_str()), ("a.obj", &obj), ("a.mtl", LIBRARY), ("b.ply", PLY)];
    load(&pack(&files), "s.json")
}

#[test]
fn a_scene_may_give_a_material_to_what_has_none() {
    let names = |loaded: Loaded| -> Vec<String> {
        let Scene { geometry, prototypes, tables } = loaded.scene;
        assert!(prototypes.is_empty());
        let name = |t: &crate::scene::Triangle| tables.materials[t.material as usize].name.clone();
        geometry.triangles.iter().map(name).collect()
    };
    let ply = r#"{"file": "b.ply", "material": "stone"}"#;
    let stone = r#", "materials": {"stone": {"type": "plain", "diffuse": [0.1, 0.2, 0.3]}}"#;
    let loaded = placed(ply, stone).unwrap();
    assert_eq!(loaded.scene.tables.materials.len(), 1);
    let surface = &loaded.scene.tables.materials[0].surface;
    assert!(matches!(surface, Surface::Plain { diffuse: [0.1, 0.2, 0.3], .. }));
    assert_eq!(names(loaded), ["stone"]);
    assert_eq!(names(placed(r#"{"file": "b.ply"}"#, "").unwrap()), ["default"]);
    let obj = r#"{"file": "a.obj", "material": "lamp"}"#;
    assert_eq!(names(placed(obj, "").unwrap()), ["lamp", "white"]);
    assert_eq!(names(placed(&obj.replace("lamp", "stone"), stone).unwrap()), ["stone", "white"]);
    let error = message(placed(&ply.replace("stone", "stony"), stone));
    assert_eq!(error, "s.json:2: there is no material \"stony\"; did you mean \"stone\"?");
    let error = message(placed(&obj.replace("lamp", "lump"), ""));
    assert_eq!(error, "s.json:2: there is no material \"lump\"; did you mean \"lamp\"?");
}

#[test]
fn a_model_that_is_placed_several_times_is_kept_once() {
    let place = |file: &str, transform: &str| {
        format!("{{\"file\": \"{file}\", \"transform\": {{{transform}}}}}")
    };
    let models = [
        place("a.obj", r#""translate": [1, 0, 0]"#),
        place("b.ply", r#""translate": [5, 0, 0]"#),
        place("./a.obj", r#""scale": [-2, 1, 1]"#),
        // All but flat: rays cannot be moved there.
        place("a.obj", r#""scale": [1, 1, 1e-9]"#),
    ];
    let stone = r#", "materials": {"default": {"emission": [1, 1, 1]}}"#;
    let loaded = placed(&models.join(", "), stone).unwrap();
    let scene = &loaded.scene;
    assert_eq!((scene.geometry.triangles.len(), scene.triangle_count()), (3, 7));
    let [prototype] = scene.prototypes.as_slice() else { panic!("one is placed twice") };
    assert_eq!(prototype.geometry.positions[1], [1.0, 0.0, 0.0]);
    let firsts: Vec<u32> = scene.placements().map(|it| it.first_primitive).collect();
    assert_eq!(firsts, [3, 5]);
    let lights: Vec<_> = scene.luminaires().iter().map(|it| (it.primitive, it.corners)).collect();
    let (a, b, c) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let moved = |x| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    let mirrored = [a, c, [-2.0, 0.0, 0.0]];
    assert_eq!(lights, [(0, moved(5.0)), (1, [a, b, c]), (3, moved(1.0)), (5, mirrored)]);
    let bounds = Bounds::of(&scene.geometry, &scene.prototypes).unwrap();
    assert!((bounds.min[0] + 2.0).abs() < 1e-6 && bounds.max[0] == 6.0, "{bounds:?}");
    assert_eq!(loaded.light_object_count, 4);

    let far = place("a.obj", r#""translate": [1e9, 0, 0]"#);
    let error = message(placed(&format!("{far}, {far}"), ""));
    assert!(error.starts_with("a.obj: the transform of its placing number 1 takes it"), "{error}");
}

#[test]
fn a_ply_file_alone_is_a_scene() {
    let loaded = load(&pack(&[("a.PLY", PLY)]), "a.PLY").unwrap();
    assert!(matches!(loaded.scene.tables.environment, Environment::Constant { .. }));
    assert_eq!(loaded.camera.target, [0.5, 0.5, 0.0]);
    let error = message(load(&pack(&[]), "a.ply"));
    assert!(error.starts_with("a.ply: no such file"), "{error}");
    let error = message(placed(r#"{"file": "c.ply"}"#, ""));
    assert!(error.starts_with("s.json:2: c.ply: no such file"), "{error}");
}

#[test]
fn what_is_missing_is_named_with_the_line_that_names_it() {
    let error = message(scene("usemtl x\nf 1 2 3\nmtllib b.mtl\n", ""));
    assert!(error.starts_with("m/a.obj:6: mtllib: m/b.mtl: no such file"), "{error}");
    let error = message(scene("mtllib a.mtl\nusemtl brick\nf 1 2 3\n", ""));
    assert!(error.starts_with("m/a.mtl:7: m/brick.png: no such file"), "{error}");
    let error = message(scene("f 1 2 3\n", ", \"environment\": {\"image\": \"sky.exr\"}"));
    assert!(error.starts_with("s.json:2: sky.exr: no such file"), "{error}");
    let error = message(load(&pack(&[]), "s.json"));
    assert!(error.starts_with("s.json: no such file"), "{error}");
    let broken = r#"{"equilux": 1, "camera": {"eye": [0, 0, 5], "target": [0, 0, 0]},
        "models": [{"file": "b.obj"}]}"#;
    let error = message(load(&pack(&[("s.json", broken)]), "s.json"));
    assert!(error.starts_with("s.json:2: b.obj: no such file"), "{error}");
}

#[test]
fn other_formats_are_refused() {
    let error = message(load(&pack(&[("a.gltf", "")]), "a.gltf"));
    assert!(error.contains("is neither a scene (.json) nor a model (.obj, .ply)"), "{error}");
    let error = message(load(&pack(&[("a.json", "\u{feff}[1]")]), "a.json"));
    assert!(error.contains("a.json:1: the file: must be an object"), "{error}");
    let latin = Pack::from_files([("a.json".into(), b"{\n\"\xe9\": 1}".to_vec())]).unwrap();
    assert!(message(load(&latin, "a.json")).starts_with("a.json:2: is not valid UTF-8"));
}

#[test]
fn a_scene_without_a_good_triangle_is_an_error() {
    let error = message(scene("v nan 0 0\nf 1 2 4\n", ""));
    assert!(error.contains("no triangle is left to render"), "{error}");
    let loaded = scene("f 1 1 2\nf 1 2 3\n", "").unwrap();
    assert_eq!(loaded.degenerate_count, 1);
    assert!(loaded.warnings.contains(&"1 degenerate triangles are left out".to_owned()));
}

#[test]
fn a_gathered_pack_loads_like_the_files_on_disk() {
    let home = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = home.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let absolute = home.path().canonicalize().unwrap().join("lib/a.mtl").display().to_string();
    write("lib/a.mtl", LIBRARY);
    write("models/a.obj", &format!("mtllib {absolute}\n{TRIANGLE}usemtl lamp\nf 1 2 3\n"));
    write("unused.obj", TRIANGLE);
    write("models/b.ply", PLY);
    let json = r#"{"equilux": 1, "camera": {"eye": [0, 0, 5], "target": [0, 0, 0]},
        "models": [{"file": "../models/a.obj"}, {"file": "../models/b.ply"}]}"#;
    write("scenes/s.json", json);
    let Gathered { pack, entry, .. } = Pack::gather(&home.path().join("scenes/s.json")).unwrap();
    let names: Vec<&str> = pack.files().map(|(name, _)| name).collect();
    assert_eq!(names, ["lib/a.mtl", "models/a.obj", "models/b.ply", "scenes/s.json"]);
    assert_eq!(entry, "scenes/s.json");
    let sent = Pack::from_bytes(&pack.to_bytes()).unwrap();
    assert_eq!(load(&sent, &entry).unwrap().light_object_count, 1);
}

proptest! {
    #[test]
    fn arbitrary_scene_files_never_panic(
        rest in "(, ?\"(film|integrator|environment|materials|cameras)\": ?\
                 [\\[{\"a-z:0-9., }\\]-]{0,20}){0,3}"
    ) {
        let _ = scene("f 1 2 3\n", &rest);
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let files = ["s.json", "a.obj", "a.ply"].map(|name| (name.to_owned(), bytes.clone()));
        let pack = Pack::from_files(files).unwrap();
        let _ = (load(&pack, "s.json"), load(&pack, "a.obj"), load(&pack, "a.ply"));
    }
}
