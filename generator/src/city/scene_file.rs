//! The scene file: camera, film, sky, and a model with a material for each finish.

use super::finish::Finish;
use super::layout::VIEW;
use super::sky;
use crate::number::{POSITION_DECIMALS, numbers};
use crate::vector::Vector;

/// The text of `scene.json`.
pub(super) fn json(finishes: impl Iterator<Item = Finish> + Clone) -> String {
    let list = |v: Vector| numbers(&[v.x, v.y, v.z], POSITION_DECIMALS).replace(' ', ", ");
    let model = |finish: Finish| {
        format!("    {{ \"file\": \"{}\", \"material\": \"{}\" }}", finish.file(), finish.name())
    };
    let material = |finish: Finish| format!("    \"{}\": {}", finish.name(), finish.to_json());
    let models: Vec<String> = finishes.clone().map(model).collect();
    let materials: Vec<String> = finishes.map(material).collect();
    let (width, height) = VIEW.size;
    [
        "{".to_owned(),
        "  \"equilux\": 1,".to_owned(),
        "  \"camera\": {".to_owned(),
        format!("    \"eye\": [{}],", list(VIEW.eye)),
        format!("    \"target\": [{}],", list(VIEW.target)),
        format!("    \"vfov\": {}", numbers(&[VIEW.vfov], POSITION_DECIMALS)),
        "  },".to_owned(),
        format!(
            "  \"film\": {{ \"width\": {width}, \"height\": {height}, \"filter\": \"{}\" }},",
            VIEW.filter
        ),
        "  \"integrator\": { \"spp\": 64, \"max_depth\": 6, \"seed\": 1 },".to_owned(),
        format!("  \"environment\": {{ \"image\": \"{}\" }},", sky::FILE),
        format!("  \"models\": [\n{}\n  ],", models.join(",\n")),
        format!("  \"materials\": {{\n{}\n  }}", materials.join(",\n")),
        "}\n".to_owned(),
    ]
    .join("\n")
}
