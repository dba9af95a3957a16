//! Differences between a house and a layout of it.

use crate::{generation::record::ChangeRecord, house::House, world::layout::Layout};

/// List the objects whose pose or support differs between house and layout.
pub(crate) fn changes_of(
    house: &House,
    layout: &Layout,
    relocated_min_m: f64,
    cause_of: impl Fn(usize) -> String,
) -> Vec<ChangeRecord> {
    let id_of = |index: Option<usize>| index.map(|i| house.objects[i].id.clone());
    let objects = house.objects.iter().zip(&layout.items).enumerate();
    let changed = objects.filter(|(_, (object, item))| {
        let now = item.placement;
        (object.position_m, object.rotation_deg, object.parent)
            != (now.position_m, now.rotation_deg, now.parent)
    });
    changed
        .map(|(index, (object, item))| {
            let now = item.placement;
            let squares =
                (0..3).map(|axis| (now.position_m[axis] - object.position_m[axis]).powi(2));
            let displacement_m = squares.sum::<f64>().sqrt();
            ChangeRecord {
                id: object.id.clone(),
                category: item.asset.category.clone(),
                from_position_m: object.position_m,
                from_rotation_deg: object.rotation_deg,
                from_support_id: id_of(object.parent),
                to_position_m: now.position_m,
                to_rotation_deg: now.rotation_deg,
                to_support_id: id_of(now.parent),
                displacement_m,
                is_relocated: displacement_m > relocated_min_m || now.parent != object.parent,
                cause: cause_of(index),
            }
        })
        .collect()
}
