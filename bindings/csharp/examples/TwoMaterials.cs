// A binary tree with two materials: leaves beyond the switch distance as single pixels, leaves before it as discs, leaves across it with
// both, each pass dropping the points of the other side. All points are there at every distance.

using System;
using System.Collections.Generic;

namespace Pointmill.Examples
{
    public sealed class TwoMaterials : IDisposable
    {
        /// <summary>A leaf as a mesh: at most 65,000 points, unless the tree was made with more per leaf.</summary>
        public sealed class Leaf
        {
            public uint Node;
            public Vector3d Place;
            public float[] Positions;
            /// <summary>Class of each point, for a colour table.</summary>
            public double[] Classes;
        }

        private readonly Dataset dataset;
        private readonly Dictionary<uint, Leaf> leaves = new Dictionary<uint, Leaf>();
        private Draw[] list;

        /// <summary>Radius of a point near by, world units.</summary>
        public double PointRadius = 0.05;

        public readonly List<Leaf> Far = new List<Leaf>();
        public readonly List<Leaf> Near = new List<Leaf>();
        /// <summary>Where discs become pixels, for the shaders of the double pass.</summary>
        public double SwitchDistance { get; private set; }

        public TwoMaterials(string path)
        {
            dataset = Dataset.Open(path, Axes.YUpLeftHanded);
            if (dataset.Info.Kind != Kind.Bintree) throw new ArgumentException("this is no binary tree", "path");
        }

        /// <summary>Reads all leaves at once, as the published renderer does; their number.</summary>
        public int LoadAll()
        {
            int classes = Array.FindIndex(dataset.Attributes, attribute => attribute.Name == "classification");
            using (Points points = new Points())
            {
                foreach (Node node in dataset.Nodes())
                {
                    if ((node.Flags & NodeFlags.Drawable) == 0) continue;
                    int count = points.Decode(dataset, node.Id);
                    Leaf leaf = new Leaf { Node = node.Id, Place = node.Center };
                    leaf.Positions = new float[3 * count];
                    leaf.Classes = new double[count];
                    points.Positions(0, count, node.Center, leaf.Positions);
                    points.Values(classes, 0, count, leaf.Classes);
                    leaves[node.Id] = leaf;
                }
            }
            return leaves.Count;
        }

        /// <summary>Sorts the leaves in sight into Far and Near; those across the switch distance are in both.</summary>
        public void Update(Camera camera)
        {
            SwitchDistance = Library.SwitchDistance(PointRadius, camera.VerticalFov, camera.Height);
            Selection selection = new Selection { Budget = ulong.MaxValue, PointRadius = PointRadius };
            int count = dataset.Select(ref camera, ref selection, ref list);
            Far.Clear();
            Near.Clear();
            for (int i = 0; i < count; i++)
            {
                Leaf leaf;
                if (!leaves.TryGetValue(list[i].Node, out leaf)) continue;
                if (list[i].Material != Material.Near) Far.Add(leaf);
                if (list[i].Material != Material.Far) Near.Add(leaf);
            }
        }

        /// <summary>What is under the cursor: the ray of a pixel, some pixels wide.</summary>
        public Hit Pick(Vector3d eye, Vector3d direction, double spread)
        {
            return dataset.Pick(new Ray { Origin = eye, Direction = direction, Spread = spread });
        }

        public void Dispose() { dataset.Dispose(); }
    }
}
