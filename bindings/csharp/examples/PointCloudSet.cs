// Several octrees as one scene: the nodes that a picture shows within a point budget, the points of those that were shown last kept
// in memory. The loading side of a renderer that draws a mesh per node; where it says "mesh", an engine makes one.

using System;
using System.Collections.Generic;

namespace Pointmill.Examples
{
    /// <summary>At most 65,000 points of a node: the vertices of one mesh.</summary>
    public sealed class MeshData
    {
        /// <summary>x, y, z relative to the middle of the node.</summary>
        public float[] Positions;
        /// <summary>Red, green, blue, alpha; null of a dataset without colours.</summary>
        public byte[] Colours;
        public int Count;
    }

    /// <summary>The meshes of a node, and where they belong.</summary>
    public sealed class LoadedNode
    {
        /// <summary>The position of the meshes. For an engine in single precision: minus an origin of the scene.</summary>
        public Vector3d Place;
        public List<MeshData> Meshes = new List<MeshData>();
        public long Points;
    }

    public sealed class PointCloudSet : IDisposable
    {
        private struct Key : IEquatable<Key>
        {
            public int Cloud;
            public uint Node;

            public bool Equals(Key other) { return Cloud == other.Cloud && Node == other.Node; }
            public override bool Equals(object other) { return other is Key && Equals((Key)other); }
            public override int GetHashCode() { return Cloud * 397 ^ (int)Node; }
        }

        private struct Wanted
        {
            public Key Key;
            public Draw Draw;
        }

        private readonly List<Dataset> clouds = new List<Dataset>();
        private readonly Dictionary<Key, LinkedListNode<KeyValuePair<Key, LoadedNode>>> loaded =
            new Dictionary<Key, LinkedListNode<KeyValuePair<Key, LoadedNode>>>();
        // shown last: first
        private readonly LinkedList<KeyValuePair<Key, LoadedNode>> byUse = new LinkedList<KeyValuePair<Key, LoadedNode>>();
        private readonly Points points = new Points();
        private Draw[] list;

        /// <summary>Points that are shown, at most.</summary>
        public ulong Budget = 1000000;
        /// <summary>Points that are kept in memory; more only if as many are shown at once.</summary>
        public long CachedPoints = 3000000;
        /// <summary>Nodes that are decoded per update, so that no picture waits for all of them.</summary>
        public int LoadsPerUpdate = 15;
        public double MinNodePixels = 30;

        /// <summary>Points in memory now.</summary>
        public long PointsInMemory { get; private set; }
        /// <summary>Nodes that were wanted in the last update but not loaded yet.</summary>
        public int Missing { get; private set; }

        public void Add(string path)
        {
            Dataset dataset = Dataset.Open(path, Axes.YUpLeftHanded);
            clouds.Add(dataset);
        }

        /// <summary>What to show from there; nodes that are missing come with later updates, the most important first.</summary>
        public List<LoadedNode> Update(Camera camera)
        {
            List<Wanted> wanted = Choose(ref camera);
            List<LoadedNode> shown = new List<LoadedNode>();
            int loads = 0;
            Missing = 0;
            foreach (Wanted one in wanted)
            {
                LinkedListNode<KeyValuePair<Key, LoadedNode>> entry;
                if (!loaded.TryGetValue(one.Key, out entry))
                {
                    if (loads++ >= LoadsPerUpdate)
                    {
                        Missing++;
                        continue;
                    }
                    entry = new LinkedListNode<KeyValuePair<Key, LoadedNode>>(
                        new KeyValuePair<Key, LoadedNode>(one.Key, Load(one.Key)));
                    loaded[one.Key] = entry;
                    PointsInMemory += entry.Value.Value.Points;
                }
                else
                {
                    byUse.Remove(entry);
                }
                byUse.AddFirst(entry);
                shown.Add(entry.Value.Value);
            }
            Evict(shown.Count);
            return shown;
        }

        /// <summary>The nodes of all clouds by their size in the picture, within the budget. A child is smaller than its parent.</summary>
        private List<Wanted> Choose(ref Camera camera)
        {
            List<Wanted> wanted = new List<Wanted>();
            Selection selection = new Selection
            {
                Budget = Budget, MinNodePixels = MinNodePixels, Order = Order.Radius, Load = true
            };
            for (int cloud = 0; cloud < clouds.Count; cloud++)
            {
                int count = clouds[cloud].Select(ref camera, ref selection, ref list);
                for (int i = 0; i < count; i++)
                    wanted.Add(new Wanted { Key = new Key { Cloud = cloud, Node = list[i].Node }, Draw = list[i] });
            }
            if (clouds.Count > 1) wanted = Merge(wanted);
            ulong total = 0;
            int fits = 0;
            while (fits < wanted.Count && (total += wanted[fits].Draw.Points) <= Budget) fits++;
            wanted.RemoveRange(fits, wanted.Count - fits);
            return wanted;
        }

        /// <summary>By size; of one cloud in the order in which they came.</summary>
        private static List<Wanted> Merge(List<Wanted> wanted)
        {
            int[] order = new int[wanted.Count];
            for (int i = 0; i < order.Length; i++) order[i] = i;
            Array.Sort(order, (a, b) =>
            {
                int bySize = wanted[b].Draw.Pixels.CompareTo(wanted[a].Draw.Pixels);
                return bySize != 0 ? bySize : a.CompareTo(b);
            });
            List<Wanted> sorted = new List<Wanted>(order.Length);
            foreach (int i in order) sorted.Add(wanted[i]);
            return sorted;
        }

        private LoadedNode Load(Key key)
        {
            Dataset dataset = clouds[key.Cloud];
            LoadedNode node = new LoadedNode { Place = dataset.Node(key.Node).Center };
            bool hasColours = dataset.Info.HasColours;
            int count = points.Decode(dataset, key.Node);
            for (int first = 0; first < count; first += Points.MeshVertices)
            {
                MeshData mesh = new MeshData { Count = Math.Min(Points.MeshVertices, count - first) };
                mesh.Positions = new float[3 * mesh.Count];
                points.Positions(first, mesh.Count, node.Place, mesh.Positions);
                if (hasColours)
                {
                    mesh.Colours = new byte[4 * mesh.Count];
                    points.Colours(first, mesh.Count, mesh.Colours);
                }
                node.Meshes.Add(mesh);
            }
            node.Points = count;
            return node;
        }

        /// <summary>Drops what was not shown for longest; never what is shown now. An engine destroys its meshes here.</summary>
        private void Evict(int shown)
        {
            while (PointsInMemory > CachedPoints && byUse.Count > shown)
            {
                KeyValuePair<Key, LoadedNode> last = byUse.Last.Value;
                byUse.RemoveLast();
                loaded.Remove(last.Key);
                PointsInMemory -= last.Value.Points;
            }
        }

        public void Dispose()
        {
            points.Dispose();
            foreach (Dataset dataset in clouds) dataset.Dispose();
            clouds.Clear();
            loaded.Clear();
            byUse.Clear();
        }
    }
}
